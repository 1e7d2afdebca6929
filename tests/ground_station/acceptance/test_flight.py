"""Promises of flown manoeuvres: what is recorded is judged, and whatever happens the fleet lands."""

import json
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet, scripted
from support.waiting import wait_for

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import LaboratoryState, LaboratoryVehicle
from rcopterx.bus.requests import GoTo
from rcopterx.bus.session import BusAddress, RawMessage, Session
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.acceptance.checks import (
    ALWAYS,
    Check,
    formation_held,
    in_time,
    remarks_on_latency,
    remarks_on_models,
)
from rcopterx.ground_station.acceptance.flight import (
    Flown,
    Manoeuvre,
    fly,
    not_flown,
    reason_not_to_fly,
    reason_of,
    report_of,
    write_report,
)
from rcopterx.ground_station.acceptance.manoeuvres import MANOEUVRES
from rcopterx.ground_station.acceptance.paper_sequence import PAPER_SET_POINTS, Say, Wait
from rcopterx.ground_station.acceptance.steps import in_order, land, take_off
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.waiting import NotReachedError, StoppedError

NAMES = ["h1", "h2"]
Lab = tuple[Fleet, dict[str, ScriptedVehicle]]


@dataclass
class Figures:
    """Latencies as a test wants them."""

    command_ms: list[float] = field(default_factory=list)
    radio_ms: list[float] = field(default_factory=list)

    def pose_to_command_ms(self) -> list[float]:
        return self.command_ms

    def frame_to_radio_ms(self) -> list[float]:
        return self.radio_ms


def recording(*states: tuple[bool, bool]) -> Recording:
    """Truth of one vehicle: on the floor, outside the volume."""
    records = []
    for frame, (on_floor, outside) in enumerate(states):
        vehicle = LaboratoryVehicle(
            position_m=(0.0, 0.0, 1.0), yaw_rad=0.0, velocity_m_s=(0.0, 0.0, 0.0), on_floor=on_floor,
            outside=outside,
        )  # fmt: skip
        state = LaboratoryState(frame=frame, sent_s=0.02 * frame, vehicles={"h1": vehicle})
        records.append(RawMessage(channels.SIMULATOR_UNIT, "laboratory", encode(state), 0.02 * frame))
    return Recording(records)


def verdicts(flown: Recording, tables: dict[str, dict[str, Any]]) -> dict[str, bool]:
    figures = FlightFigures(flown, ["h1"])
    return {check.name: check.run(figures, tables)["passed"] for check in ALWAYS}


def test_a_clean_flight_passes_every_check() -> None:
    assert all(verdicts(recording((False, False)), {"h1": {"ticks": 50, "missed_ticks": 0}}).values())


@pytest.mark.parametrize(
    ("flown", "table", "failed"),
    [
        (recording((False, False)), {"ticks": 0, "missed_ticks": 0}, "every vehicle ticked"),
        (recording((False, False)), {"ticks": 9, "missed_ticks": 1}, "no control period was missed"),
        (
            recording((False, False), (True, False)),
            {"ticks": 9, "missed_ticks": 0},
            "no vehicle touched the floor",
        ),
        (recording((False, True)), {"ticks": 9, "missed_ticks": 0}, "no vehicle left the flight volume"),
    ],
)
def test_each_fault_fails_its_own_check(flown: Recording, table: dict[str, int], failed: str) -> None:
    assert [name for name, passed in verdicts(flown, {"h1": table}).items() if not passed] == [failed]


@pytest.mark.parametrize(
    ("figures", "passed"),
    [(Figures([30.0], [3.0, 19.9]), True), (Figures([1.0], [30.0]), False), (Figures([1.0]), False)],
)
def test_frames_must_reach_the_radio_within_a_control_period(figures: Figures, passed: bool) -> None:
    result = in_time.run(figures, {})  # type: ignore[arg-type]  # only latencies
    assert result["passed"] == passed
    assert result["name"] == "frame to radio, p99 within a control period of 20 ms"


@pytest.mark.parametrize(
    ("command_ms", "radio_ms", "remarks"),
    [
        (5.0, 12.0, []),
        (8.1, 12.0, ["pose to command slower than usual: p99 8.1 ms, on an idle computer at most 5 ms"]),
        (None, 15.0, ["frame to radio slower than usual: p99 15 ms, on an idle computer at most 12 ms"]),
    ],
)
def test_latencies_above_those_of_an_idle_computer_are_remarked_on(
    command_ms: float | None, radio_ms: float, remarks: list[str]
) -> None:
    report = {
        "pose_to_command_ms": command_ms and {"p99": command_ms},
        "frame_to_radio_ms": {"p99": radio_ms},
    }
    assert remarks_on_latency(report) == remarks


@pytest.mark.parametrize(("rms_mm", "advised"), [(39.0, False), (41.0, True)])
def test_a_formation_that_is_not_held_is_advised_to_be_identified(rms_mm: float, advised: bool) -> None:
    table = {"formation_error_mm": {"rms": rms_mm, "max": 90.0}}
    line = formation_held().run(FlightFigures(recording((False, False)), ["h1"]), {"h1": table})
    report = {"problem": None, "checks": [line]}
    remarks = remarks_on_models(report)
    assert any("rcopterx identify --all" in remark for remark in remarks) == advised
    reason = reason_of({**report, "remarks": remarks})
    assert reason.startswith("formation error at most 40 mm" if advised else "")
    assert ("identify" in reason) == advised


def manoeuvre(flown: Callable[[Fleet, Say, Wait], None], *checks: Check) -> Manoeuvre:
    return Manoeuvre("test", "A test", 1.0, flown, checks)


@pytest.fixture
def lab(
    bus_address: BusAddress, join: Callable[..., Session], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Lab]:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    text = fleet_file_text(bus_address).replace(
        '"radio-h2" }', '"radio-h2" }\nfollow = [{ leader = "h1", offset_m = [-0.4, 0.5, 0.0] }]'
    )
    with scripted(join(), *NAMES) as vehicles, patient_fleet(parse_fleet(text)) as fleet:
        wait_for(lambda: all(not vehicle.state.problems() for vehicle in fleet), "no status arrives")
        yield fleet, vehicles


def test_a_manoeuvre_takes_off_flies_records_and_lands(lab: Lab) -> None:
    fleet, vehicles = lab
    lines: list[str] = []

    def flown(running: Fleet, say: Say, wait: Wait) -> None:
        running["h1"].go_to((0.1, 0.2, 0.3))
        say("there")
        count = 0

        def more() -> bool:
            nonlocal count
            count += 1
            return count > 20

        running.wait_until(more, 10, "never")

    result = fly(manoeuvre(flown), fleet, lines.append, lambda _: None)
    assert lines == ["take-off to 1 m", "there", "landing"]
    assert vehicles["h1"].verbs == ["Arm", "TakeOff", "GoTo", "Land", "Disarm"]
    phases = {message.phase for message, _ in result.recording.messages(channels.AGENT_STATUS, "h1")}
    assert phases == {"flying"}
    assert [text for _, text in result.journal] == ["there"]
    assert result.problem is None


def test_manoeuvre_that_fails_lands_the_fleet_and_reports_the_problem(lab: Lab) -> None:
    fleet, vehicles = lab
    vehicles["h1"].refusals["go_to"] = "no"

    def flown(running: Fleet, say: Say, wait: Wait) -> None:
        running["h1"].go_to((0.1, 0.2, 0.3))

    result = fly(manoeuvre(flown), fleet, lambda _: None, lambda _: None)
    assert result.problem == "h1: no"
    report = report_of(manoeuvre(flown), result, NAMES, 1.0)
    assert (report["verdict"], report["problem"]) == ("failed", "h1: no")
    assert [vehicle.phase for vehicle in vehicles.values()] == ["ground", "ground"]


def test_the_papers_formation_sends_the_leader_and_moves_the_followers(lab: Lab) -> None:
    fleet, vehicles = lab
    waited: list[float] = []
    row = MANOEUVRES["paper-formation"]
    row.fly(fleet, lambda _: None, waited.append)
    goals = [request for request in vehicles["h1"].requests if isinstance(request, GoTo)]
    assert [(goal.set_point.position_m, goal.set_point.yaw_rad) for goal in goals] == list(PAPER_SET_POINTS)
    offsets = [request.following[0].offset_m for request in vehicles["h2"].requests]  # type: ignore[attr-defined]  # Follow
    assert offsets == [pytest.approx((-0.6, 0.5, 0.1)), (-0.4, 0.5, 0.0)]
    assert sum(waited) == row.seconds


def test_landing_that_fails_is_reported_beside_the_earlier_problem(lab: Lab) -> None:
    fleet, vehicles = lab
    vehicles["h1"].refusals["land"] = "cannot"

    def flown(running: Fleet, say: Say, wait: Wait) -> None:
        running["h1"].follow("h1")
        raise NotReachedError("too far")

    result = fly(manoeuvre(flown), fleet, lambda _: None, lambda _: None)
    assert result.problem == "too far; landing: h1: cannot"
    vehicles["h1"].refusals.clear()
    fleet.land()


def test_ctrl_c_in_a_manoeuvre_lands_the_fleet(lab: Lab) -> None:
    fleet, vehicles = lab

    def flown(running: Fleet, say: Say, wait: Wait) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly(manoeuvre(flown), fleet, lambda _: None, lambda _: None)
    assert [vehicle.phase for vehicle in vehicles.values()] == ["ground", "ground"]


def test_a_stop_ends_the_waits_of_a_manoeuvre_and_leaves_landing_to_who_stopped_it(lab: Lab) -> None:
    fleet, vehicles = lab
    stop = threading.Event()

    def flown(running: Fleet, say: Say, wait: Wait) -> None:
        stop.set()
        running.wait_for_phase("ground", timeout_s=1000)

    with pytest.raises(StoppedError):
        fly(manoeuvre(flown), fleet, lambda _: None, lambda _: None, stop)
    assert [vehicle.phase for vehicle in vehicles.values()] == ["flying", "flying"]


def test_a_manoeuvre_from_the_floor_records_its_own_take_off_and_landing(lab: Lab) -> None:
    fleet, vehicles = lab
    row = replace(MANOEUVRES["take-off-and-land"], fly=in_order(take_off(), flying, land()))
    result = fly(row, fleet, lambda _: None, lambda _: None)
    assert vehicles["h1"].verbs == ["Arm", "TakeOff", "Land", "Disarm"]
    phases = [message.phase for message, _ in result.recording.messages(channels.AGENT_STATUS, "h1")]
    assert {"flying", "ground"} <= set(phases)


def flying(fleet: Fleet, say: Say, wait: Wait) -> None:
    fleet.wait_for_phase("flying")


def test_manoeuvre_that_a_fleet_cannot_fly_has_a_reason(lab: Lab) -> None:
    fleet, _ = lab
    assert reason_not_to_fly(manoeuvre(flying), fleet) == "made for the fleet trio; lab has no h3"
    row = replace(manoeuvre(flying), fleet="trio")
    with_three = SimpleNamespace(file=SimpleNamespace(vehicles=["h1", "h2", "h3"], name="x"), launcher=None)
    assert reason_not_to_fly(row, with_three) is None  # type: ignore[arg-type]  # only what it reads
    report = not_flown(row, "not flown", "because")
    assert (report["verdict"], report["problem"], report["checks"]) == ("not flown", "because", [])


def test_hovering_asks_nothing_of_anybody(lab: Lab) -> None:
    fleet, vehicles = lab
    waited: list[float] = []
    MANOEUVRES["hover"].fly(fleet, lambda _: None, waited.append)
    assert sum(waited) == MANOEUVRES["hover"].seconds
    assert vehicles["h1"].requests == []


@pytest.mark.parametrize(("passed", "verdict"), [(True, "passed"), (False, "failed")])
def test_the_report_holds_everything_and_its_verdict_is_that_of_the_checks(
    passed: bool, verdict: str, tmp_path: Path
) -> None:
    row = manoeuvre(
        lambda *_: None, Check("always", lambda *_: (True, 1)), Check("this", lambda *_: (passed, 2))
    )
    flown = Flown(recording((False, False)), ((0.5, "there"),))
    report = report_of(row, flown, ["h1"], 12.34)
    path = write_report(report, tmp_path / "new" / "directory")
    assert json.loads(path.read_text()) == json.loads(json.dumps(report))
    assert path.name == "report.json"
    assert report["verdict"] == verdict
    assert report["seconds"] == 12.3
    assert report["checks"][1] == {"name": "this", "passed": passed, "figure": 2}
    assert report["journal"] == [{"at_s": 0.5, "text": "there"}]
    assert {"manoeuvre", "pose_to_command_ms", "frame_to_radio_ms", "vehicles"} <= report.keys()
    assert {
        "formation_error_mm", "tracking_error_mm", "ticks", "missed_ticks", "fallbacks", "solve_ms",
    } <= report["vehicles"]["h1"].keys()  # fmt: skip
