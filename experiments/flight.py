"""Flies a manoeuvre on a running fleet, records it, judges it."""

import json
import time
from pathlib import Path
from typing import Any

from experiments.manoeuvres import Manoeuvre, Say, Wait
from ground_station.fleet import Fleet
from ground_station.recorder import Recorder, Recording
from ground_station.report import FlightFigures, percentiles

REPORT_NAME = "report.json"


def fly(manoeuvre: Manoeuvre, fleet: Fleet, say: Say, wait: Wait = time.sleep) -> Recording:
    """Take off, fly, land; what happens in the air in between is recorded.

    Raises
    ------
    RefusedError, NotReachedError
        A vehicle refused, or did not get where it should; everything is landed first.
    """
    recorder = Recorder(fleet.session)
    try:
        say(f"take-off to {manoeuvre.height_m:g} m")
        fleet.take_off(height_m=manoeuvre.height_m)
        wait(2.0)
        recorder.start()
        manoeuvre.fly(fleet, say, wait)
        return recorder.stop()
    finally:
        say("landing")
        fleet.land()


def report_of(
    manoeuvre: Manoeuvre, recording: Recording, vehicles: list[str], seconds: float
) -> dict[str, Any]:
    """Everything `report.json` holds."""
    figures = FlightFigures(recording, vehicles)
    tables = {name: figures.vehicle(name) for name in vehicles}
    checks = [check.run(figures, tables) for check in manoeuvre.checks]
    return {
        "manoeuvre": manoeuvre.name,
        "seconds": round(seconds, 1),
        "verdict": "passed" if all(check["passed"] for check in checks) else "failed",
        "checks": checks,
        "pose_to_command_ms": percentiles(figures.pose_to_command_ms()),
        "frame_to_radio_ms": percentiles(figures.frame_to_radio_ms()),
        "vehicles": tables,
    }


def write_report(report: dict[str, Any], directory: Path) -> Path:
    """Write `report.json` into a directory, which is created if missing."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / REPORT_NAME
    path.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return path
