"""Promises of reports: whole, self-contained, in order, and nothing from a flight is markup."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.pictures import draw_nothing
from support.statuses import flying_status

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import encode
from rcopterx.bus.log_messages import AnsweredRequest, LauncherEvent
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Kill, Plan, Pose, TransmitterStatus
from rcopterx.bus.requests import Reply, TakeOff
from rcopterx.bus.session import RawMessage
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.ground_station.events import LoggedEvent
from rcopterx.ground_station.report.document import Html, table
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.logged_flight import LoggedFlight, events_of, logged_flight
from rcopterx.ground_station.report.page import comparison_page, report_page, sections
from rcopterx.ground_station.report.playback import MAX_SAMPLES, flight_data, playback
from rcopterx.ground_station.report.recorder import Recording

REFERENCE = Path(__file__).parents[2] / "fixtures" / "reference_flight.mcap"
VOLUME = ((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0))


@pytest.fixture(scope="module")
def flight() -> LoggedFlight:
    return logged_flight("reference", [REFERENCE])


def record(channel: Channel, unit: str, message: Message, arrived_s: float) -> RawMessage:
    return RawMessage(unit, channel.topic, encode(message), arrived_s)


def test_a_report_is_whole_and_refers_to_nothing_outside_itself(flight: LoggedFlight) -> None:
    page = report_page(flight)
    for title, _ in sections(flight):
        assert f"<h2>{title}</h2>" in page
    assert page.count("<svg") >= 2
    assert flight.metadata["digest"] in page
    assert not re.findall(r"(?:src|href)=[\"'](?!#)", page)
    assert not re.findall(r"@import|url\((?!#)", page)


def test_a_report_tells_what_it_could_not_read(flight: LoggedFlight, monkeypatch: pytest.MonkeyPatch) -> None:
    draw_nothing(monkeypatch)
    assert "left out" not in report_page(flight)
    assert "plan.type 7" in report_page(replace(flight, rejected={"plan.type": 7}))


def test_a_report_says_what_its_log_lacks(flight: LoggedFlight, monkeypatch: pytest.MonkeyPatch) -> None:
    draw_nothing(monkeypatch)
    assert "The log is complete" in report_page(flight)
    page = report_page(replace(flight, missing=("bytes 7 to 9",)))
    assert "The log is incomplete" in page
    assert "bytes 7 to 9" in page


def test_two_flights_stand_side_by_side(flight: LoggedFlight, monkeypatch: pytest.MonkeyPatch) -> None:
    draw_nothing(monkeypatch)
    page = comparison_page(flight, flight)
    assert page.count('<div class="beside">') == 1 + len(list(sections(flight)))
    assert page.count("<h1>reference</h1>") == 2


def test_vehicles_of_a_logged_flight_have_flown_and_their_figures_are_known(flight: LoggedFlight) -> None:
    assert list(flight.fleet.vehicles)
    for name in flight.fleet.vehicles:
        assert len(flight.figures.flown(name)[0]) > 10
        assert flight.figures.vehicle(name)["ticks"] > 0


def test_a_flight_in_which_nothing_was_seen_is_refused(tmp_path: Path) -> None:
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"nothing")
    with pytest.raises(FlightLogError, match=r"empty\.mcap"):
        logged_flight("empty", [empty])


def test_events_are_told_in_order_whoever_saw_them() -> None:
    def transmitter(state: str, reason: str) -> TransmitterStatus:
        return TransmitterStatus(state=state, reason=reason, link="ready", module="ready", ready=True)

    accepted, refused = (encode(Reply(accepted=one, reason="too <high>")) for one in (True, False))

    def answered(reply: bytes) -> AnsweredRequest:
        return AnsweredRequest(
            verb="take_off", request=encode(TakeOff(height_m=1.0)), reply=reply, took_s=0.0
        )

    kill = Kill(source="page", reason="space bar")
    records = [
        record(channels.TRANSMITTER_STATUS, "h1", transmitter("disarmed", "begun"), 100.0),
        record(channels.AGENT_STATUS, "h1", flying_status(phase="ground"), 100.1),
        record(channels.ANSWERED, "h1", answered(refused), 101.0),
        record(channels.ANSWERED, "h1", answered(accepted), 102.0),
        record(channels.AGENT_STATUS, "h1", flying_status(phase="takeoff"), 102.1),
        record(channels.LAUNCHER_EVENT, "main", LauncherEvent(text="h1 was killed"), 103.0),
        *(record(channels.KILL, "fleet", kill, 104.0 + 0.1 * number) for number in range(20)),
        record(channels.TRANSMITTER_STATUS, "h1", transmitter("killed", "by page"), 104.05),
        record(channels.KILL, "fleet", kill, 120.0),
    ]  # fmt: skip
    events = events_of(Recording(records), 100.0)
    assert [(round(event.time_s, 2), event.text) for event in events] == [
        (1.0, "take_off refused: too <high>"),
        (2.0, "take_off"),
        (2.1, "ground → takeoff"),
        (3.0, "h1 was killed"),
        (4.0, "KILL all vehicles: space bar"),
        (4.05, "transmitter killed: by page"),
        (20.0, "KILL all vehicles: space bar"),
    ]
    assert [event.alarming for event in events] == [True, False, False, False, True, True, True]


def flown(frames: list[int]) -> FlightFigures:
    """A vehicle that was seen in these frames, at x = frame / 100, with a reference at x = 1."""
    records = []
    for frame in frames:
        pose = Pose(
            epoch=1, frame=frame, period_s=0.02, latency_s=0.0, received_s=0.0, occluded=False,
            position_m=(frame / 100, 0.0, 1.0), quaternion_xyzw=(0.0, 0.0, 0.0, 1.0),
        )  # fmt: skip
        plan = Plan(
            epoch=1, frame=frame, source="h1", ancestors=(), period_s=0.02, start_s=0.0,
            trajectory=TrajectoryArray.of(np.zeros((2, 12))), reference=(1.0, 0.0, 1.0, 0.0),
        )  # fmt: skip
        records += [record(channels.POSE, "h1", pose, 0.0), record(channels.PLAN, "h1", plan, 0.0)]
    return FlightFigures(Recording(records), ["h1"])


def test_a_playback_shows_places_at_their_times_and_nothing_where_nothing_was_seen() -> None:
    data = flight_data(flown([*range(1000, 1101), *range(1201, 1301)]), ["h1"], [], VOLUME)
    assert data["seconds"] == pytest.approx(6.0)
    places = data["vehicles"][0]["flown"]
    assert len(places) == data["samples"]
    at_1_s = places[round(1.0 / data["step"])]
    assert at_1_s == pytest.approx([10.5, 0.0, 1.0, 0.0], abs=0.011)
    assert places[round(3.5 / data["step"])] is None
    assert data["vehicles"][0]["wanted"][0] == [1.0, 0.0, 1.0]


def test_a_playback_of_a_long_flight_stays_small() -> None:
    data = flight_data(flown(list(range(0, 60_000, 50))), ["h1"], [], VOLUME)
    assert data["samples"] <= MAX_SAMPLES + 1


def test_no_text_of_a_flight_ends_the_script_of_its_playback() -> None:
    event = LoggedEvent(0.5, "h1", "</script><b>", True)
    element = playback("a", flown([0, 1, 2]), ["h1"], [event], VOLUME)
    assert element.count("</script>") == 2
    text = element.split('<script type="application/json">')[1].split("</script>")[0]
    assert json.loads(text)["events"][0]["text"] == "h1: </script><b>"


def test_cells_are_escaped_unless_they_are_markup_already() -> None:
    shown = table(("<h>",), [("<a>",), (Html("<b>x</b>"),), (("<c>", "failed"),)])
    assert "<th>&lt;h&gt;</th>" in shown
    assert "<td>&lt;a&gt;</td>" in shown
    assert "<td><b>x</b></td>" in shown
    assert '<td class="failed">&lt;c&gt;</td>' in shown
