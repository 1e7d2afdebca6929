"""Promises of films: a recorded flight is what its page showed at each time, and stays small."""

import json
from typing import Any

import pytest
from msgspec.json import encode
from support.plans import plan_of
from support.recorded_flight import Flight
from support.statuses import flying_status

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import encode as packed
from rcopterx.bus.host_messages import TrackerStatus
from rcopterx.bus.message import Message
from rcopterx.bus.messages import TransmitterStatus
from rcopterx.bus.session import RawMessage
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.report.film import MAX_STEPS, filmed
from rcopterx.ground_station.report.logged_bus import LoggedBus

FLEET = parse_fleet('name = "solo"\n[vehicles.h1]\nsubject = "h1"\ntransmitter = { port = "radio-h1" }\n')
ARMED = TransmitterStatus(state="armed", reason="", link="open", module="ready", ready=True)
TRACKER = TrackerStatus(state="up", trying="", address="")
STARTED_S = 100.0


def at(time_s: float, channel: Channel[Any], message: Message, unit: str = "h1") -> RawMessage:
    return RawMessage(unit, channel.topic, packed(message), STARTED_S + time_s)


def flown(seconds: float, silent: tuple[float, float] = (0.0, 0.0)) -> list[RawMessage]:
    """A vehicle that flies along x at 1 m/s, and of which nothing arrives in an interval."""
    records = []
    for step in range(round(10 * seconds)):
        time_s = step / 10
        if silent[0] <= time_s < silent[1]:
            continue
        place = (time_s, 0.0, 1.0)
        status = flying_status(position_m=place, phase="takeoff" if time_s < 1.0 else "flying")
        records += [
            at(time_s, channels.AGENT_STATUS, status),
            at(time_s, channels.TRANSMITTER_STATUS, ARMED),
            at(time_s, channels.PLAN, plan_of("h1", position_m=place, reference_m=(time_s, 0.5, 1.0))),
        ]
    return records


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
    shown = film(flown(5.0))
    assert len(shown["motion"]) == len(shown["samples"])
    step = step_at(shown, 2.0)
    assert shown["motion"][step]["h1"]["place"] == [2.0, 0.0, 1.0]
    assert shown["motion"][step]["h1"]["reference"] == [2.0, 0.5, 1.0]
    names = [name for name, *_ in shown["fleet"]["signals"]]
    assert dict(zip(names, shown["samples"][step][1], strict=True))["error_mm"] == 500.0


def test_a_film_has_the_words_of_each_moment() -> None:
    shown = film(flown(5.0))
    assert texts_at(shown, 0.5)["sentence"]["text"] == "1 takes off"
    assert texts_at(shown, 3.0)["sentence"]["text"] == "1 flies"
    assert texts_at(shown, 3.0)["rows"]["h1"]["chip"]["text"] == "flies"
    assert [text for _, _, text, _ in texts_at(shown, 3.0)["events"]] == ["takeoff → flying"]


def test_nothing_is_drawn_and_nobody_flies_while_no_process_reports() -> None:
    shown = film(flown(12.0, silent=(4.0, 10.0)))
    assert shown["motion"][step_at(shown, 8.0)] == {"h1": {}}
    assert texts_at(shown, 8.0)["sentence"]["text"] == "no process of the fleet reports"
    assert not texts_at(shown, 8.0)["rows"]
    assert texts_at(shown, 11.5)["sentence"]["text"] == "1 flies"


def test_a_film_of_a_long_flight_has_fewer_steps_a_second() -> None:
    shown = film([*flown(1.0), at(3600.0, channels.AGENT_STATUS, flying_status())])
    assert len(shown["motion"]) <= MAX_STEPS + 2
    assert shown["samples"][-1][0] >= 3600.0


def test_a_film_begins_with_the_first_status_of_an_agent() -> None:
    flight = Flight()
    flight.pose("h1", 1, (0.0, 0.0, 0.0))
    early = [record._replace(arrived_s=STARTED_S) for record in flight.records]
    tracker = at(0.0, channels.TRACKER_STATUS, TRACKER, channels.TRACKER_UNIT)
    later = [record._replace(arrived_s=record.arrived_s + 7.0) for record in flown(2.0)]
    assert film([*early, tracker, *later])["samples"][0][0] == 7.0


def test_messages_of_a_flight_arrive_when_they_arrived() -> None:
    bus = LoggedBus(flown(2.0), STARTED_S)
    statuses, one = bus.subscribe_all(channels.AGENT_STATUS), bus.subscribe(channels.AGENT_STATUS, "h1")
    assert bus.advance(0.55)
    received = statuses.inboxes["h1"].latest()
    assert received is not None
    assert received.message.position_m == (0.5, 0.0, 1.0)
    assert received.arrived_s == pytest.approx(0.5)
    assert one.age_s(bus.clock()) == pytest.approx(0.05)
    assert not bus.advance(10.0)


def test_statuses_of_the_tracker_are_none_of_vehicles() -> None:
    bus = LoggedBus([at(0.0, channels.TRACKER_STATUS, TRACKER, channels.TRACKER_UNIT)], STARTED_S)
    agents, tracker = (
        bus.subscribe_all(channels.AGENT_STATUS),
        bus.subscribe(channels.TRACKER_STATUS, "tracker"),
    )
    bus.advance(1.0)
    assert not agents.inboxes
    assert tracker.latest() is not None
