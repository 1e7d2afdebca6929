"""Promises of films: a recorded flight is what its page showed at each time, and stays small."""

import json
from typing import Any

import pytest
from msgspec.json import encode
from support.filmed_flight import ENDS_S, FLEET, STARTED_S, at, messages
from support.statuses import flying_status

from rcopterx.bus import channels
from rcopterx.bus.host_messages import TrackerStatus
from rcopterx.bus.session import RawMessage
from rcopterx.ground_station.report.film import MAX_STATES, LoggedBus, filmed

TRACKER = TrackerStatus(state="up", trying="", address="")


def film(records: list[RawMessage]) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(encode(filmed("a", FLEET, records, STARTED_S)))
    return content


def step_at(film: dict[str, Any], time_s: float) -> int:
    return max(step for step, row in enumerate(film["samples"]) if row[0] <= time_s + 1e-6)


def texts_at(film: dict[str, Any], time_s: float) -> dict[str, Any]:
    """Texts as the page puts them together: each entry has what has changed."""
    shown: dict[str, Any] = {}
    for step, changed in film["texts"]:
        if step <= step_at(film, time_s):
            shown |= changed
    return shown


def test_a_film_has_the_places_plans_and_samples_of_each_moment() -> None:
    shown = film(messages())
    assert len(shown["motion"]) == len(shown["samples"])
    step = step_at(shown, 4.0)
    assert shown["motion"][step]["h2"]["place"] == pytest.approx([0.4, 0.5, 1.0], abs=1e-3)
    assert shown["motion"][step]["h2"]["reference"] == pytest.approx([0.4, 0.52, 1.0], abs=1e-3)
    names = [name for name, *_ in shown["fleet"]["signals"]]
    assert dict(zip(names, shown["samples"][step][2], strict=True))["error_mm"] == pytest.approx(20, abs=0.5)


def test_a_film_has_the_words_of_each_moment() -> None:
    shown = film(messages())
    assert texts_at(shown, 1.5)["sentence"]["text"] == "2 take off, formation within 20 mm"
    assert texts_at(shown, 5.0)["sentence"]["text"] == "2 fly, formation within 20 mm"
    assert texts_at(shown, 5.0)["rows"]["h2"]["chip"]["text"] == "flies"
    events = [text for _, _, text, _ in texts_at(shown, 5.0)["events"]]
    assert events == ["takeoff → flying", "ground → takeoff"]


def test_nothing_is_drawn_and_nobody_flies_while_no_process_reports() -> None:
    shown = film(messages(silent_s=(3.0, 7.0)))
    assert shown["motion"][step_at(shown, 6.0)] == {"h1": {}, "h2": {}}
    assert texts_at(shown, 6.0)["sentence"]["text"] == "no process of the fleet reports"
    assert not texts_at(shown, 6.0)["rows"]
    assert texts_at(shown, 7.6)["sentence"]["text"].startswith("2 fly")


def test_a_film_of_a_long_flight_has_fewer_steps_a_second() -> None:
    shown = film([*messages(), at(3600.0, channels.AGENT_STATUS, flying_status())])
    assert len(shown["motion"]) * len(FLEET.vehicles) <= MAX_STATES + 4
    assert shown["samples"][-1][0] >= 3600.0


def test_a_film_begins_with_the_first_status_of_an_agent() -> None:
    tracker = at(0.0, channels.TRACKER_STATUS, TRACKER, channels.TRACKER_UNIT)
    later = [record._replace(arrived_s=record.arrived_s + 7.0) for record in messages()]
    assert film([tracker, *later])["samples"][0][0] == 7.0


def test_messages_of_a_flight_arrive_when_they_arrived() -> None:
    bus = LoggedBus(messages(), STARTED_S)
    statuses, one = bus.subscribe_all(channels.AGENT_STATUS), bus.subscribe(channels.AGENT_STATUS, "h1")
    assert bus.advance(0.55)
    received = statuses.inboxes["h2"].latest()
    assert received is not None
    assert received.message.position_m == pytest.approx((0.05, 0.5, 0.0))
    assert received.arrived_s == pytest.approx(0.5)
    assert one.age_s(bus.clock()) == pytest.approx(0.05)
    assert not bus.advance(ENDS_S)


def test_statuses_of_the_tracker_are_none_of_vehicles() -> None:
    bus = LoggedBus([at(0.0, channels.TRACKER_STATUS, TRACKER, channels.TRACKER_UNIT)], STARTED_S)
    agents = bus.subscribe_all(channels.AGENT_STATUS)
    tracker = bus.subscribe(channels.TRACKER_STATUS, channels.TRACKER_UNIT)
    bus.advance(1.0)
    assert not agents.inboxes
    assert tracker.latest() is not None
