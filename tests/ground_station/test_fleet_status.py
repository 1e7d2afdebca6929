"""Promises of status and checks: everything that is known, in JSON, and what is missing by name."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from support.plans import plan_of
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet, scripted
from support.waiting import wait_for

from rcopterx.bus.host_messages import LauncherStatus, SubjectState, TrackerStatus
from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.session import BusAddress, Session
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.notes import (
    STALLED_S,
    launcher_notes,
    tracker_notes,
    tracker_problems,
)
from rcopterx.ground_station.scripting.state import error_of, shown_heading_deg
from rcopterx.ground_station.terminal.status import fleet_check, fleet_status, readable

Vehicles = dict[str, ScriptedVehicle]


def tracker(state: str = "up", *subjects: SubjectState) -> TrackerStatus:
    return TrackerStatus(state=state, trying="is silent", address="x:801", period_s=0.02, subjects=subjects)


def test_the_status_of_a_ready_fleet_names_everything_and_is_json(fleet: Fleet) -> None:
    status = json.loads(json.dumps(fleet_status(fleet)))
    assert (status["ready"], status["problems"]) == (True, [])
    assert status["tracker"]["rate_hz"] == 50
    assert set(status["vehicles"]) == {"h1", "h2"}
    vehicle = status["vehicles"]["h1"]
    assert (vehicle["phase"], vehicle["airborne"], vehicle["error_mm"]) == ("ground", False, None)
    assert vehicle["agent"]["controller"] == "paper"
    assert vehicle["agent"]["position_m"] == [0.1, 0.2, 0.3]
    assert vehicle["transmitter"]["state"] == "disarmed"
    assert vehicle["pose_age_s"] < 1
    text = readable(status, fleet)
    assert text.startswith("lab: ready\n  h1: ground, transmitter disarmed, flown by paper, leads")


def test_a_fleet_nobody_heard_of_has_a_status_with_what_is_missing(
    bus_address: BusAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    with patient_fleet(parse_fleet(fleet_file_text(bus_address, ("h7",)))) as fleet:
        assert not fleet.wait_for_status(timeout_s=0.05)
        status = json.loads(json.dumps(fleet_status(fleet)))
        text = readable(status, fleet)
    assert status["tracker"] is None
    assert status["vehicles"]["h7"]["agent"] is status["vehicles"]["h7"]["transmitter"] is None
    assert status["problems"] == [
        "Vicon gateway not responding",
        "h7: agent not responding",
        "h7: transmitter gateway not responding",
    ]
    assert "  h7: unknown, transmitter unknown\n  - Vicon gateway not responding" in text


def test_subjects_of_no_vehicle_and_a_recording_are_told_and_keep_nobody_on_the_floor() -> None:
    stranger, known = SubjectState(subject="wand"), SubjectState(subject="heli1", vehicle="h1")
    status = tracker("up", known, stranger, SubjectState(subject="gone", listed=False))
    assert tracker_notes(None) == []
    assert tracker_notes(status) == ["subject 'wand' is in no vehicle"]
    assert tracker_problems(status, 0.1, ["h1"]) == []
    recorded = msgspec.structs.replace(status, subjects=(), recording="512 bytes in session.raw")
    assert tracker_notes(recorded) == ["raw recording: 512 bytes in session.raw"]
    text = readable({"fleet": "lab", "ready": True, "problems": [], "notes": tracker_notes(status)})
    assert text == "lab: ready\n  note: subject 'wand' is in no vehicle"


def test_a_check_names_what_is_missing_of_the_vehicles_it_is_asked_for(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    vehicles["h2"].ready = False
    wait_for(lambda: fleet.problems(), "no problem is seen")
    assert fleet_check(fleet, ["h1"])["ready"]
    found = fleet_check(fleet)
    assert not found["ready"]
    assert found["problems"] == ["h2: transmitter not ready: module speaks"]
    assert readable(found) == "lab: not ready\n  - h2: transmitter not ready: module speaks"


def test_a_vehicle_that_is_covered_is_told_with_the_time_since_it_was_seen(
    fleet: Fleet, vehicles: Vehicles
) -> None:
    vehicles["h1"].occluded_s = 3.2
    wait_for(lambda: (fleet.state_of("h1").seen_age_s or 0) > 3, "not seen as covered")
    (problem,) = fleet.problems(["h1"])
    assert problem.startswith("h1: the motion capture does not see it for 3.")
    assert fleet.problems(["h2"]) == []


@pytest.mark.parametrize(
    ("status", "age_s", "problems"),
    [
        (None, None, ["Vicon gateway not responding"]),
        (tracker(), 2.0, ["Vicon gateway not responding for 2.0 s"]),
        (tracker("connecting"), 0.1, ["Tracker: is silent; does it run, and stream at tracker.address?"]),
        (tracker(), 0.1, []),
        (tracker("up", SubjectState(subject="box", listed=False)), 0.1, []),
        (tracker("up", SubjectState(subject="x", vehicle="h9", listed=False)), 0.1, []),
        (
            tracker("up", SubjectState(subject="heli1", vehicle="h1", listed=False)),
            0.1,
            ["h1: subject 'heli1' is not in the Tracker's list (it lists: nothing)"],
        ),
        (
            tracker(
                "up",
                SubjectState(subject="Heli 1", vehicle="h1", listed=False),
                SubjectState(subject="heli2", vehicle="h2", ambiguous=True),
                SubjectState(subject="heli1 "),
            ),
            0.1,
            [
                "h1: subject 'Heli 1' is not in the Tracker's list (it lists: 'heli2', 'heli1 ')",
                "h2: the Tracker lists several subjects 'heli2'",
            ],
        ),
        (
            tracker(
                "up",
                SubjectState(subject="heli1", vehicle="h1", same_place_as="old"),
                SubjectState(subject="heli2", vehicle="h2", shown_at_m=(1000.2, 499.7, 20.0)),
            ),
            0.1,
            [
                "h1: 'heli1' and 'old' are shown at the same place: one body for two subjects? Disable "
                "one in the Tracker",
                "heli2 is shown at (1000, 500, 20) m: millimetres?",
            ],
        ),
    ],
)
def test_what_the_vicon_gateway_says_against_a_take_off_is_told(
    status: TrackerStatus | None, age_s: float | None, problems: list[str]
) -> None:
    assert tracker_problems(status, age_s, ["h1", "h2"]) == problems


def test_the_error_of_a_flying_vehicle_is_the_distance_to_its_reference() -> None:
    plan = plan_of("h1", position_m=(0.375, 0.5, 1.0))
    assert error_of(plan) is None
    with_reference = type(plan)(
        **{name: getattr(plan, name) for name in plan.__struct_fields__} | {"reference": (0.0, 0.0, 1.0, 0.0)}
    )
    assert error_of(with_reference) == pytest.approx(0.625)


def test_the_status_tells_whom_a_vehicle_follows(
    fleet: Fleet, vehicles: Vehicles, join: Callable[..., Session]
) -> None:
    vehicles["h2"].following = (LeaderLink(leader="h1", offset_m=(1.0, 0.0, 0.0)),)
    wait_for(lambda: fleet.state_of("h2").leaders == ("h1",), "the leader is not known")
    status = fleet_status(fleet)
    (link,) = status["vehicles"]["h2"]["agent"]["following"]
    assert (link["leader"], link["offset_m"], link["frame"]) == ("h1", [1.0, 0.0, 0.0], "inertial")
    assert "h2: ground, transmitter disarmed, flown by paper, follows h1" in readable(status, fleet)


def test_the_status_tells_what_is_done_about_a_lost_leader(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].assigned = (LeaderLink(leader="h1", offset_m=(1.0, 0.0, 0.0)),)
    vehicles["h2"].following_mode = "hold"
    wait_for(
        lambda: fleet_status(fleet)["vehicles"]["h2"]["agent"]["following_mode"] == "hold",
        "its following mode is not known",
    )
    agent = fleet_status(fleet)["vehicles"]["h2"]["agent"]
    assert agent["following"] == []
    assert [link["leader"] for link in agent["assigned"]] == ["h1"]
    assert agent["client"] is None


def test_a_tracker_that_gives_no_frames_is_named_first(
    bus_address: BusAddress, join: Callable[..., Session], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    with (
        patient_fleet(parse_fleet(fleet_file_text(bus_address))) as fleet,
        scripted(join(), tracker="connecting"),
    ):
        wait_for(lambda: fleet.tracker.latest() is not None, "the Vicon gateway does not speak")
        assert (
            fleet.problems()[0]
            == "Tracker: is silent [/dev/null]; does it run, and stream at tracker.address?"
        )


def test_restarts_hangs_and_a_watchdog_that_is_off_are_remarks() -> None:
    quiet = LauncherStatus(running=("h1",), absent=(), restarts={"router": 0}, watchdog=True)
    assert launcher_notes("main", quiet) == []
    broken = msgspec.structs.replace(
        quiet, restarts={"router": 0, "agent-h1": 3, "tracker": 1}, hung={"agent-h1": 2}, watchdog=False
    )
    assert launcher_notes("main", broken) == [
        "host main: started again: agent-h1 3 (2 hung), tracker 1",
        "host main: the watchdog is off, processes that hang are not replaced",
    ]


def test_a_launcher_that_does_not_check_its_processes_is_reported() -> None:
    status = LauncherStatus(running=("h1",), absent=(), watchdog=True, stalled_s=STALLED_S)
    (line,) = launcher_notes("main", status)
    assert line == "host main: the launcher has not checked its processes for 2 s; land"
    assert launcher_notes("main", msgspec.structs.replace(status, stalled_s=STALLED_S / 2)) == []


def test_a_host_with_more_agents_than_it_serves_is_told() -> None:
    status = LauncherStatus(running=("h1", "h2"), absent=(), watchdog=True)
    for flies in ((), (2, 3, 4, 5), (7, 8, 9, 9)):
        assert launcher_notes("main", msgspec.structs.replace(status, flies=flies)) == []
    (line,) = launcher_notes("main", msgspec.structs.replace(status, measuring=True))
    assert line == "host main: measures how many vehicles it can fly; take-off waits for the result"
    (line,) = launcher_notes("main", msgspec.structs.replace(status, flies=(1, 1, 2, 3)))
    assert line.startswith(
        "host main: can fly about 1 such vehicles, but runs the agents of 2, which therefore control one "
    )
    (line,) = launcher_notes("main", msgspec.structs.replace(status, flies=(0, 0, 1, 1)))
    assert line.startswith(
        "host main: runs the agents of 2 vehicles, but can fly at most about 1, and 0 without lower "
    )


@pytest.mark.parametrize(
    ("yaw_deg", "shown"),
    [(0.0, 0), (190.0, -170), (-180.0, 180), (180.0, 180), (4863.0, -177), (-0.2, 0), (-179.8, 180)],
)
def test_headings_are_shown_within_half_a_turn(yaw_deg: float, shown: int) -> None:
    assert shown_heading_deg(math.radians(yaw_deg)) == shown
