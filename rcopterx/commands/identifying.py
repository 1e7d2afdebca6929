"""Steps of `rcopterx identify`: fly or load, fit, print, draw, write."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from rcopterx.commands.fleet_option import failure, known_vehicles, running_fleet, user_errors
from rcopterx.control.identification import fit
from rcopterx.control.identification.fit import AHEAD_S, Identification, predicted_ahead
from rcopterx.control.identification.parameters import Candidate
from rcopterx.control.identification.recording import FlightRecording, RecordingError, load_recording
from rcopterx.fleet.editing import check_own, write_model
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.fleet.shipped import fleet_path
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.identification.identification import IdentificationError, excited_flight
from rcopterx.ground_station.scripting.joining import fleet_that_is_up
from rcopterx.vehicles.model import Model

PICTURED_S = 10.0
AXES = ("x [m]", "y [m]", "z [m]", "yaw [rad]")


@dataclass(frozen=True)
class Excitation:
    """Excitation: duration, fraction of the usual strength, and largest distance from the set point."""

    seconds: float
    strength: float
    reach_m: float


@dataclass(frozen=True)
class Outputs:
    """Outputs of an identification."""

    save: Path | None
    plot: Path | None
    dry_run: bool
    as_json: bool


def identify_vehicle(
    vehicle: str, fleet: str | None, flight: Excitation | Path, positions_only: bool, outputs: Outputs
) -> None:
    """Fit the model of a vehicle to a flight that is flown now, or to a recorded one."""

    def say(text: str) -> None:
        typer.echo(text, err=outputs.as_json)

    with user_errors():
        path = None if fleet is None else fleet_path(fleet)
        if not outputs.dry_run:
            # Fail before the flight if the model could not be written.
            if path is None:
                raise FleetError("name the fleet file that the model goes into (-f FILE), or give --dry-run")
            check_own(path)
        file = fleet_that_is_up()[0] if path is None else load_fleet(path)
        known_vehicles(file.vehicles, [vehicle])
        known = model_of(file, vehicle)
    try:
        recording = load_recording(flight) if isinstance(flight, Path) else _fly(vehicle, flight, fleet, say)
        if outputs.save is not None:
            recording.save(outputs.save)
            say(f"recording: {outputs.save}")
        if positions_only:
            recording = recording.without_tilt()
        say(f"fitting {recording.duration_s:.0f} s of flight")
        found = fit.identify(recording, known)
    except (IdentificationError, RecordingError, ValueError, OSError) as error:
        raise failure(f"{vehicle}: {error}") from None
    if outputs.plot is not None:
        _draw(recording, known, found, outputs.plot)
        say(f"figure: {outputs.plot}")
    _show(vehicle, found, outputs.as_json, say)
    if found.problems:
        raise failure(*(f"{vehicle}: {problem}" for problem in found.problems))
    if path is not None and not outputs.dry_run:
        _write(path, vehicle, found.model, say)


def _fly(vehicle: str, flight: Excitation, fleet: str | None, say: Callable[[str], None]) -> FlightRecording:
    with running_fleet(fleet) as running:
        running.wait_for_status([vehicle])
        say(f"{vehicle}: excitation for {flight.seconds:g} s")
        return excited_flight(
            running,
            vehicle,
            flight.seconds,
            flight.strength,
            flight.reach_m,
            lambda left_s: say(f"{vehicle}: {left_s:.0f} s left"),
        )


def _show(vehicle: str, found: Identification, as_json: bool, say: Callable[[str], None]) -> None:
    if as_json:
        typer.echo(json.dumps(document_of(vehicle, found), indent=2))
        return
    say(f"{'parameter':22}{'before':>10}{'now':>10}{'+-':>9}  unit")
    for number in found.parameters:
        say(
            f"{number.name:22}{number.before:10.4g}{number.value:10.4g}{number.deviation:9.2g}  {number.unit}"
        )
    before, after = found.before, found.after
    say(f"predicted {AHEAD_S:g} s ahead, off by (rms, in flight that was not fitted):")
    say(f"  horizontal  {1e3 * before.horizontal_m:6.1f} -> {1e3 * after.horizontal_m:6.1f} mm")
    say(f"  height      {1e3 * before.height_m:6.1f} -> {1e3 * after.height_m:6.1f} mm")
    say(f"  heading     {1e3 * before.yaw_rad:6.1f} -> {1e3 * after.yaw_rad:6.1f} mrad")


def document_of(vehicle: str, found: Identification) -> dict[str, Any]:
    """JSON document of an identification."""
    return {
        "vehicle": vehicle,
        "parameters": [asdict(number) for number in found.parameters],
        "offsets": asdict(found.offsets),
        "one_second_ahead": {"before": asdict(found.before), "after": asdict(found.after)},
        "problems": list(found.problems),
        "model": asdict(found.model),
    }


def _write(path: Path, vehicle: str, model: Model, say: Callable[[str], None]) -> None:
    with user_errors():
        lines = write_model(path, vehicle, model)
    for line in lines or ["nothing to change"]:
        say(f"{vehicle}: {line}")
    say(f"{vehicle}: the model is in {path}; land and start the fleet again to fly with it")


def _draw(recording: FlightRecording, known: Model, found: Identification, file: Path) -> None:
    """Measured motion, and predictions one second ahead by both models, over the last seconds."""
    from matplotlib.figure import Figure

    shown = slice(-round(PICTURED_S / recording.period_s), None)
    curves = (
        ("measured", "k-", np.column_stack((recording.position_m, recording.yaw_rad))),
        (
            "predicted by the model before",
            "C1--",
            predicted_ahead(Candidate(known, found.offsets), recording),
        ),
        ("and now", "C0-", predicted_ahead(Candidate(found.model, found.offsets), recording)),
    )
    time_s = recording.period_s * np.arange(len(recording.yaw_rad))
    figure = Figure(figsize=(9, 8), layout="constrained")
    for at, (axes, name) in enumerate(zip(figure.subplots(4, 1, sharex=True), AXES, strict=True)):
        for label, style, rows in curves:
            axes.plot(time_s[shown], rows[shown, at], style, label=label)
        axes.set_ylabel(name)
        axes.grid(alpha=0.3)
    figure.axes[0].legend(fontsize="small", ncols=3)
    figure.axes[0].set_title(f"Predicted {AHEAD_S:g} s ahead")
    figure.axes[-1].set_xlabel("time [s]")
    figure.savefig(file)
