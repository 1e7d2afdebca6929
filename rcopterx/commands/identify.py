"""Fitting the model of a vehicle to its own flight: `identify`."""

import json
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcopterx.commands.fleet_option import (
    RunningFleetOption,
    failure,
    known_vehicles,
    running_fleet,
    user_errors,
    wanted_fleet,
)
from rcopterx.commands.output import JsonOption, PlotOption, check_plot, print_changes, write_plot

if TYPE_CHECKING:
    from rcopterx.control.identification.fit import Identification
    from rcopterx.control.identification.recording import FlightRecording
    from rcopterx.vehicles.model import Model

PICTURED_S = 10.0
AXES = ("x [m]", "y [m]", "z [m]", "yaw [rad]")


def identify(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE")],
    seconds: Annotated[
        float, typer.Option(metavar="SECONDS", min=20, max=300, help="Duration of the excitation.")
    ] = 70.0,
    strength: Annotated[
        float, typer.Option(metavar="FRACTION", min=0.1, max=2, help="Fraction of the usual excitation.")
    ] = 1.0,
    reach: Annotated[
        float, typer.Option(metavar="METRES", min=0.1, max=2, help="Largest distance from the set point.")
    ] = 0.4,
    from_file: Annotated[
        Path | None, typer.Option("--from", metavar="FILE", help="Fit a recorded flight instead of flying.")
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Save the recording in this file (.npz).")
    ] = None,
    plot: PlotOption = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print the model without changing the fleet file.")
    ] = False,
    as_json: JsonOption = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Excite a hovering vehicle, fit its model to the flight, and write it into the fleet file.

    The vehicle must hover without following (rcopterx lead VEHICLE), with room around it.
    """
    check_plot(plot)
    from rcopterx.control.identification import fit
    from rcopterx.control.identification.recording import load_recording
    from rcopterx.fleet.editing import write_model
    from rcopterx.fleet.vehicle_models import model_of

    say = partial(typer.echo, err=as_json)
    with user_errors():
        path = None if dry_run else _own_file(fleet)
        file, _ = wanted_fleet(fleet)
        known_vehicles(file.vehicles, [vehicle])
        known = model_of(file, vehicle)
    try:
        excitation = (seconds, strength, reach)
        recording = load_recording(from_file) if from_file else _flown(vehicle, fleet, excitation, say)
        if save is not None:
            recording.save(save)
            say(f"recording: {save}")
        say(f"fitting {recording.duration_s:.0f} s of flight")
        found = fit.identify(recording, known)
    except (ValueError, OSError) as error:
        raise failure(f"{vehicle}: {error}") from None
    write_plot(partial(_draw, recording, known, found), plot)
    typer.echo(json.dumps(document_of(vehicle, found), indent=2) if as_json else _text(found))
    for remark in found.remarks:
        say(f"{vehicle}: {remark}")
    if found.problems:
        raise failure(*(f"{vehicle}: {problem}" for problem in found.problems))
    if path is not None:
        with user_errors():
            print_changes(vehicle, write_model(path, vehicle, found.model), err=as_json)
        say(f"{vehicle}: the model is in {path}; land and start the fleet again to fly with it")


def _flown(
    vehicle: str, fleet: str | None, excitation: tuple[float, float, float], say: Callable[[str], None]
) -> "FlightRecording":
    from rcopterx.ground_station.identification.identification import excited_flight

    with running_fleet(fleet) as running:
        running.wait_for_status([vehicle])
        say(f"{vehicle}: excitation for {excitation[0]:g} s")
        return excited_flight(
            running, vehicle, *excitation, lambda left_s: say(f"{vehicle}: {left_s:.0f} s left")
        )


def _own_file(fleet: str | None) -> Path:
    """Fleet file of the user, into which the model goes; checked before the flight."""
    from rcopterx.fleet.editing import check_own
    from rcopterx.fleet.reading import fleet_path
    from rcopterx.fleet.schema import FleetError

    if fleet is None:
        raise FleetError("name the fleet file that the model goes into (-f FILE), or give --dry-run")
    path = fleet_path(fleet)
    check_own(path)
    return path


def _text(found: "Identification") -> str:
    from rcopterx.control.identification.fit import AHEAD_S

    before, after = found.before, found.after
    return "\n".join(
        [
            f"{'parameter':22}{'before':>10}{'now':>10}{'+-':>9}  unit",
            *(
                f"{one.name:22}{one.before:10.4g}{one.value:10.4g}{one.deviation:9.2g}  {one.unit}"
                for one in found.parameters
            ),
            f"predicted {AHEAD_S:g} s ahead, off by (rms, in flight that was not fitted):",
            f"  horizontal  {1e3 * before.horizontal_m:6.1f} -> {1e3 * after.horizontal_m:6.1f} mm",
            f"  height      {1e3 * before.height_m:6.1f} -> {1e3 * after.height_m:6.1f} mm",
            f"  heading     {1e3 * before.yaw_rad:6.1f} -> {1e3 * after.yaw_rad:6.1f} mrad",
        ]
    )


def document_of(vehicle: str, found: "Identification") -> dict[str, Any]:
    """JSON document of an identification."""
    return {
        "vehicle": vehicle,
        "parameters": [asdict(number) for number in found.parameters],
        "offsets": asdict(found.offsets),
        "one_second_ahead": {"before": asdict(found.before), "after": asdict(found.after)},
        "problems": list(found.problems),
        "remarks": list(found.remarks),
        "model": asdict(found.model),
    }


def _draw(recording: "FlightRecording", known: "Model", found: "Identification", figure: Any) -> None:
    """Measured motion, and predictions one second ahead by both models, over the last seconds."""
    import numpy as np

    from rcopterx.control.identification.fit import AHEAD_S, predicted_ahead
    from rcopterx.control.identification.parameters import Candidate

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
    figure.set_size_inches(9, 8)
    for at, (axes, name) in enumerate(zip(figure.subplots(4, 1, sharex=True), AXES, strict=True)):
        for label, style, rows in curves:
            axes.plot(time_s[shown], rows[shown, at], style, label=label)
        axes.set_ylabel(name)
        axes.grid(alpha=0.3)
    figure.axes[0].legend(fontsize="small", ncols=3)
    figure.axes[0].set_title(f"Predicted {AHEAD_S:g} s ahead")
    figure.axes[-1].set_xlabel("time [s]")
    figure.tight_layout()
