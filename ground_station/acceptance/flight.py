"""A manoeuvre, flying it on a running fleet, and its report."""

import json
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.ground_station.acceptance.checks import Check, remarks_on_latency, remarks_on_models
from rcopterx.ground_station.acceptance.paper_sequence import Say, Wait
from rcopterx.ground_station.acceptance.steps import Step
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import FlightSampler, Recording
from rcopterx.ground_station.report.statistics import percentiles
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS, lines_of
from rcopterx.ground_station.scripting.waiting import Stop, StoppedError, stopped_by

DEFAULT_FLEET = "trio"
REPORT_NAME = "report.json"
SETTLE_S = 2.0  # from the end of the take-off to the beginning of the recording


@dataclass(frozen=True)
class Manoeuvre:
    """One row of the table."""

    name: str
    title: str
    seconds: float  # approximate duration of the recorded part
    fly: Step  # flies it on a fleet that is in the air
    checks: tuple[Check, ...]  # conditions on the recorded flight
    fleet: str = DEFAULT_FLEET  # shipped fleet with which it can be flown
    from_floor: bool = False  # take-off and landing are part of the manoeuvre and recorded


@dataclass(frozen=True)
class Flown:
    """A flown manoeuvre."""

    recording: Recording  # messages on the bus
    journal: tuple[tuple[float, str], ...] = ()  # steps with the time since the recording began [s]
    problem: str | None = None  # why the manoeuvre ended early, None if it did not


def fly(manoeuvre: Manoeuvre, fleet: Fleet, say: Say, wait: Wait, stop: Stop | None = None) -> Flown:
    """Take off, fly and land; records the part in between.

    `wait` waits in the time of the fleet. Raises `StoppedError`: `stop` was set; its owner lands the fleet.
    """
    recorder, clock, journal = FlightSampler(fleet.session), fleet.session.clock, list[tuple[float, str]]()
    stop = stop or threading.Event()
    problem, began_s = None, clock()

    def note(text: str) -> None:
        journal.append((round(clock() - began_s, 2), text))
        say(text)

    try:
        with stopped_by(stop):
            if not manoeuvre.from_floor:
                say("take-off to 1 m")
                fleet.take_off(height_m=1.0)
                wait(SETTLE_S)
            began_s = clock()
            recorder.start()
            manoeuvre.fly(fleet, note, wait)
    except StoppedError:
        raise
    except FLIGHT_ERRORS as error:
        problem = str(error)
        note(f"ended early: {problem}")
    finally:
        recording = recorder.stop()
        if not stop.is_set() and (problem is not None or not manoeuvre.from_floor):
            problem = _landed(fleet, say, problem)
    return Flown(recording, tuple(journal), problem)


def _landed(fleet: Fleet, say: Say, problem: str | None) -> str | None:
    """Land; returns the problem of the flight joined with that of the landing."""
    say("landing")
    try:
        fleet.land()
    except FLIGHT_ERRORS as error:
        landing = f"landing: {'; '.join(lines_of(error))}"
        return landing if problem is None else f"{problem}; {landing}"
    return problem


def report_of(manoeuvre: Manoeuvre, flown: Flown, vehicles: Sequence[str], seconds: float) -> dict[str, Any]:
    """Contents of `report.json`."""
    figures = FlightFigures(flown.recording, vehicles)
    tables = {name: figures.vehicle(name) for name in vehicles}
    checks = [check.run(figures, tables) for check in manoeuvre.checks]
    passed = flown.problem is None and all(check["passed"] for check in checks)
    report = not_flown(manoeuvre, "passed" if passed else "failed", flown.problem) | {
        "seconds": round(seconds, 1),
        "checks": checks,
        "pose_to_command_ms": percentiles(figures.pose_to_command_ms()),
        "frame_to_radio_ms": percentiles(figures.frame_to_radio_ms()),
        "vehicles": tables,
        "journal": [{"at_s": at_s, "text": text} for at_s, text in flown.journal],
    }
    report["remarks"] = remarks_on_models(report) + remarks_on_latency(report)
    return report


def not_flown(manoeuvre: Manoeuvre, verdict: str, problem: str | None) -> dict[str, Any]:
    """Report of a manoeuvre that was not flown."""
    return {
        "manoeuvre": manoeuvre.name,
        "title": manoeuvre.title,
        "seconds": 0.0,
        "verdict": verdict,
        "problem": problem,
        "checks": [],
        "pose_to_command_ms": None,
        "frame_to_radio_ms": None,
        "remarks": [],
        "vehicles": {},
        "journal": [],
    }


def reason_of(report: Mapping[str, Any]) -> str:
    """Why a manoeuvre failed or was not flown, and remarks."""
    failed = [check["name"] for check in report["checks"] if not check["passed"]]
    return report["problem"] or "; ".join((*failed, *report["remarks"]))


def write_report(report: dict[str, Any], directory: Path) -> Path:
    """Write `report.json` into a directory, which is created if missing."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / REPORT_NAME
    path.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return path


def reason_not_to_fly(manoeuvre: Manoeuvre, fleet: Fleet) -> str | None:
    """Reason why a running fleet cannot fly a manoeuvre; None if it can."""
    made_for = load_fleet(fleet_path(manoeuvre.fleet)).vehicles
    if missing := [name for name in made_for if name not in fleet.file.vehicles]:
        return f"made for the fleet {manoeuvre.fleet}; {fleet.file.name} has no {', '.join(missing)}"
    return None
