"""Promises of reports: whole, self-contained, in order, and nothing from a flight is markup."""

import base64
import json
import re
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.statuses import flying_status

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import encode
from rcopterx.bus.log_messages import AnsweredRequest, LauncherEvent
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Kill, TransmitterStatus
from rcopterx.bus.requests import Reply, TakeOff
from rcopterx.bus.session import RawMessage
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.ground_station.report.document import Html, table
from rcopterx.ground_station.report.logged_flight import LoggedFlight, events_of, logged_flight
from rcopterx.ground_station.report.page import FOLDED, report_page
from rcopterx.ground_station.report.recorder import Recording

REFERENCE = Path(__file__).parents[2] / "fixtures" / "reference_flight.mcap"


@pytest.fixture(scope="module")
def flight() -> LoggedFlight:
    return logged_flight("reference", [REFERENCE])


def record(channel: Channel, unit: str, message: Message, arrived_s: float) -> RawMessage:
    return RawMessage(unit, channel.topic, encode(message), arrived_s)


@pytest.fixture(scope="module")
def page(flight: LoggedFlight) -> str:
    return report_page(flight)


def films(page: str) -> list[dict[str, Any]]:
    data = re.search(r'id="films">([^<]*)</script>', page)
    assert data is not None
    found: list[dict[str, Any]] = json.loads(zlib.decompress(base64.b64decode(data[1])))
    return found


def test_a_report_is_the_page_with_its_figures_first_and_the_rest_folded(
    page: str, flight: LoggedFlight
) -> None:
    figures, played = page.index('id="figures"'), page.index('<section id="stage">')
    assert figures < page.index("formation error rms") < page.index("solver: controller") < played
    for title in FOLDED:
        assert page.index(f"<summary>{title}</summary>") > played
    assert page.count("<details") == page.count("</details>")
    assert "<details open" not in page
    assert flight.metadata["digest"] in page


def test_a_report_says_in_its_bar_that_it_is_a_recording_and_of_which_day(page: str) -> None:
    assert '<p id="recorded">Recording of 2026-11-29 08:04</p>' in page


def test_a_report_has_nothing_that_only_a_running_fleet_has(page: str) -> None:
    for control in ('id="kill"', 'value="take_off"', 'id="goto"', 'id="tune"', 'name="controller"'):
        assert control not in page


def test_a_report_refers_to_nothing_outside_itself_and_is_small(page: str) -> None:
    document = re.sub(r"<script.*?</script>", "", page, flags=re.S)
    assert not re.findall(r"(?:src|href)=[\"'](?!#|data:)", document)
    assert not re.findall(r"@import|url\((?!#)", page)
    imports = json.loads(page.split('<script type="importmap">')[1].split("</script>")[0])["imports"]
    for name, address in imports.items():
        source = base64.b64decode(address.partition(",")[2]).decode()
        assert not re.search(r"""^import .*['"]\.""", source, flags=re.M), f"{name} imports a path"
        assert set(re.findall(r"^import .*'(.*)';", source, flags=re.M)) <= set(imports), name
    assert len(page) < 1_200_000


def test_a_report_says_what_could_not_be_read(flight: LoggedFlight, page: str) -> None:
    assert "left out" not in page
    assert "plan.type 7" in report_page(replace(flight, rejected={"plan.type": 7}))


def test_a_report_says_first_what_its_log_lacks(flight: LoggedFlight, page: str) -> None:
    assert "The log is incomplete" not in page
    page = report_page(replace(flight, missing=("bytes 7 to 9",)))
    assert (
        page.index("The log is incomplete") < page.index("bytes 7 to 9") < page.index("formation error rms")
    )


def test_two_flights_stand_side_by_side_and_both_can_be_played(flight: LoggedFlight) -> None:
    page = report_page(flight, replace(flight, name="<other>"))
    assert page.count("<h2>Flight ") == 2
    assert "<h2>Flight &lt;other&gt;</h2>" in page
    assert page.count('<p id="recorded">Recording of 2026-11-29 08:04 and 2026-11-29 08:04</p>') == 1
    assert [film["name"] for film in films(page)] == ["reference", "<other>"]


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


def test_cells_are_escaped_unless_they_are_markup_already() -> None:
    shown = table(("<h>",), [("<a>",), (Html("<b>x</b>"),), (("<c>", "failed"),)])
    assert "<th>&lt;h&gt;</th>" in shown
    assert "<td>&lt;a&gt;</td>" in shown
    assert "<td><b>x</b></td>" in shown
    assert '<td class="failed">&lt;c&gt;</td>' in shown
