"""Preparing vehicles: `types`, `identify` and `margins`."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from rcopterx.commands.extensions import added
from rcopterx.commands.fleet_option import (
    EXIT_FAILED,
    FleetArgument,
    RunningFleetOption,
    failure,
    fleet_file,
    running_fleet,
    wanted_fleet,
)
from rcopterx.commands.output import (
    JsonOption,
    PlotOption,
    print_changes,
    print_document,
    print_table,
    write_plot,
)
from rcopterx.commands.parsing import check_known
from rcopterx.commands.steer import Vehicles

if TYPE_CHECKING:
    from rcopterx.control.identification.recording import FlightRecording
    from rcopterx.control.identification.result import Identification
    from rcopterx.fleet.schema import FleetFile
    from rcopterx.ground_station.scripting.fleet import Fleet

Say = Callable[[str], None]

REACH_M = 0.4
PICTURED_S = 10.0
AXES = ("x [m]", "y [m]", "z [m]", "yaw [rad]")
ERRORS = ("horizontal_m", "height_m", "yaw_rad")  # of the parts of a model


def types(as_json: JsonOption = False) -> None:
    """List the vehicle types that fleet files and new-lab can name, those of installed packages included."""
    from rcopterx.fleet.vehicle_types import type_names, vehicle_type

    found = [vehicle_type(name) for name in type_names()]
    document = {
        one.name: {
            "text": one.file.text,
            "protocol": one.file.transmitter.protocol,
            "settings": one.file.transmitter.settings,
            "airframe": one.model.airframe,
            "thrust_to_weight": one.model.input_gain[2] / one.model.gravity_m_s2,
            "hover_thrust": one.model.hover_thrust,
            "lowest_ceiling_m": one.file.lowest_ceiling_m,
        }
        for one in found
    }
    width = max(map(len, document))
    lines = (f"{one.name:{width}}  {one.file.text}" for one in found)
    print_document(document, as_json, lambda _: "\n".join(lines))


def margins(fleet: FleetArgument, vehicles: Vehicles = None, as_json: JsonOption = False) -> None:
    """Show gain, phase and delay margins of vehicles as a fleet file configures them.

    Also the peak of the sensitivity, and how many joint corners of the model's uncertainty are stable.
    Exit code 1 if an axis falls short of what the uncertainty of its model requires.
    """
    from rcopterx.ground_station.terminal.margins import COLUMNS, fleet_margins, rows_of

    file = fleet_file(fleet)
    check_known(vehicles or (), file.vehicles, "vehicle", "VEHICLE")
    document = fleet_margins(file, vehicles or file.vehicles)
    found = document["vehicles"]
    if as_json:
        print_document(document, as_json)
    else:
        headings = [heading.replace(" ", "\n", 1) for heading in COLUMNS]
        print_table(headings, (row for name in found for row in rows_of(name, found[name])))
    axes = (axis for vehicle in found.values() for axis in (vehicle["axes"] or {}).values())
    if any(axis["below_rule"] for axis in axes):
        raise typer.Exit(EXIT_FAILED)


def identify(
    vehicles: list[str] | None = None,
    together: bool = False,
    seconds: float = 60.0,
    strength: float = 1.0,
    reach: float | None = None,
    from_files: list[Path] | None = None,
    columns: Path | None = None,
    save: Path | None = None,
    plot: PlotOption = None,
    dry_run: bool = False,
    as_json: JsonOption = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Excite hovering vehicles, fit their models, fly on with them, and write them into the fleet file.

    A named vehicle must hover without following (rcopterx lead VEHICLE), with room around it. With --all the
    vehicles of a formation move apart first, and return at the end. Without --fleet only this flight uses
    the models.
    """
    names, say = vehicles or [], partial(typer.echo, err=as_json)
    if bool(names) == together:
        raise typer.BadParameter("name vehicles, or give --all")
    if len(names) != 1 and (from_files or save or plot):
        raise typer.BadParameter("--from, --save and --plot are for one vehicle")
    if save is not None and len(from_files or ()) > 1:
        raise typer.BadParameter("--save is for one flight")
    path = None if dry_run or not (fleet or from_files) else _own_file(fleet)
    file, _ = wanted_fleet(fleet)
    check_known(names, file.vehicles, "vehicle", "VEHICLE")
    failures: dict[str, str] = {}
    with nullcontext() if from_files else running_fleet(fleet) as running:
        if running is None:
            flights = {names[0]: [_loaded(file, names[0], one, columns) for one in from_files or ()]}
        else:
            flights, failures = _flown(running, names, (seconds, strength), reach, say)
        if save is not None and flights:
            flights[names[0]][0].save(save)
            say(f"recording: {save}")
        fits = {name: _fit(file, name, recordings, say) for name, recordings in flights.items()}
        if plot is not None and fits:
            write_plot(partial(_draw, file, names[0], flights[names[0]][0], fits[names[0]]), plot)
        _print(fits, failures, together, as_json)
        for name, found in fits.items():
            _use(name, found, path, None if dry_run else running, say)
    failed = [(name, problem) for name, found in fits.items() for problem in found.problems]
    if problems := [f"{name}: {problem}" for name, problem in (*failures.items(), *failed)]:
        raise failure(*problems)


def _loaded(file: "FleetFile", name: str, path: Path, columns: Path | None) -> "FlightRecording":
    from rcopterx.control.identification.recording import RecordingError, load_recording

    try:
        if not path.name.endswith((".csv", ".csv.gz")):
            return load_recording(path)
        studies = added("identify", "identify --from FILE.csv")
        found: FlightRecording = studies.recorded_flight(file, name, path, columns)
        return found
    except RecordingError as error:
        raise failure(f"{name}: {error}") from None


def _flown(
    running: "Fleet", names: list[str], wanted: tuple[float, float], reach: float | None, say: Say
) -> tuple[dict[str, list["FlightRecording"]], dict[str, str]]:
    """Fly the excitation of some vehicles, or with all of a formation; return recordings and failures."""
    from rcopterx.ground_station.identification import identification as flights

    flown = names or running.present()
    running.wait_for_status(flown)
    if not names:
        say(f"{', '.join(flown)}: move apart")
    in_place = nullcontext(flights.Apart(reach or REACH_M, {}))
    with in_place if names else flights.room_for_all(running, flown, reach) as apart:
        restless, excitation = flights.swinging(running, flown), flights.Wanted(*wanted, apart.reach_m)
        flown = [name for name in flown if name not in restless]
        say(f"{', '.join(flown)}: excitation for {excitation.duration_s:g} s within {apart.reach_m:g} m")
        found, failures = flights.excited_flights(
            running, flown, excitation, lambda left_s: say(f"{left_s:.0f} s left")
        )
    return {name: [recording] for name, recording in found.items()}, restless | failures | apart.not_back


def _fit(file: "FleetFile", name: str, flights: "list[FlightRecording]", say: Say) -> "Identification":
    from rcopterx.control.identification import fit
    from rcopterx.fleet.vehicle_models import model_of

    say(f"{name}: fitting {sum(flight.duration_s for flight in flights):.0f} s of flight")
    try:
        return fit.identify(flights[0], model_of(file, name), *flights[1:])
    except ValueError as error:
        raise failure(f"{name}: {error}") from None


def _use(name: str, found: "Identification", path: Path | None, running: "Fleet | None", say: Say) -> None:
    """Write the accepted parts of a model into the fleet file, if any, and let the vehicle fly with them."""
    from rcopterx.fleet.editing import write_model
    from rcopterx.vehicles.model import fitted_parameters

    for remark in found.remarks:
        say(f"{name}: {remark}")
    if not found.accepted:
        return
    if found.problems:
        say(f"{name}: of the model only {', '.join(found.accepted)} can be used")
    if path is not None:
        print_changes(name, write_model(path, name, found.model), say)
        say(f"{name}: the model is in {path}")
    if running is not None:
        running[name].use_model(fitted_parameters(found.model))
        say(f"{name}: it flies with the model")


def _print(
    fits: "dict[str, Identification]", failures: dict[str, str], together: bool, as_json: bool
) -> None:
    if not as_json:
        for name, found in fits.items():
            typer.echo((f"{name}:\n" if together or len(fits) > 1 else "") + _text(found))
        return
    documents = [document_of(name, found) for name, found in fits.items()]
    alone = len(fits) == 1 and not (together or failures)
    print_document(documents[0] if alone else {"vehicles": documents, "failed": failures}, as_json)


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

    quantities = (("horizontal", "mm"), ("height", "mm"), ("heading", "mrad"))
    return "\n".join(
        [
            f"{'parameter':22}{'before':>10}{'now':>10}{'+-':>9}  unit",
            *(
                f"{one.name:22}{one.before:10.4g}{one.value:10.4g}{one.deviation:9.2g}  {one.unit}"
                for one in found.parameters
            ),
            f"predicted {AHEAD_S:g} s ahead, off by (rms, in flight that was not fitted):",
            *(
                f"  {name:12}{1e3 * part.before:6.1f} -> {1e3 * part.after:6.1f} {unit}"
                for (name, unit), part in zip(quantities, found.parts, strict=True)
            ),
        ]
    )


def document_of(vehicle: str, found: "Identification") -> dict[str, Any]:
    """JSON document of an identification."""
    before, after = zip(*((part.before, part.after) for part in found.parts), strict=True)
    return {
        "vehicle": vehicle,
        "parameters": [asdict(number) for number in found.parameters],
        "offsets": asdict(found.offsets),
        "one_second_ahead": {
            "before": dict(zip(ERRORS, before, strict=True)),
            "after": dict(zip(ERRORS, after, strict=True)),
        },
        "accepted": list(found.accepted),
        "problems": list(found.problems),
        "remarks": list(found.remarks),
        "model": asdict(found.model),
    }


def _draw(
    file: "FleetFile", name: str, recording: "FlightRecording", found: "Identification", figure: Any
) -> None:
    """Measured motion, and predictions one second ahead by both models, over the last seconds."""
    import numpy as np

    from rcopterx.control.identification.fit import AHEAD_S, predicted_ahead
    from rcopterx.control.identification.motions import Candidate
    from rcopterx.fleet.vehicle_models import model_of

    before, after = (Candidate(model, found.offsets) for model in (model_of(file, name), found.model))
    shown = slice(-round(PICTURED_S / recording.period_s), None)
    curves = (
        ("measured", "k-", np.column_stack((recording.position_m, recording.yaw_rad))),
        ("predicted by the model before", "C1--", predicted_ahead(before, recording)),
        ("and now", "C0-", predicted_ahead(after, recording)),
    )
    time_s = recording.period_s * np.arange(len(recording.yaw_rad))
    figure.set_size_inches(9, 8)
    for at, (axes, quantity) in enumerate(zip(figure.subplots(4, 1, sharex=True), AXES, strict=True)):
        for label, style, rows in curves:
            axes.plot(time_s[shown], rows[shown, at], style, label=label)
        axes.set_ylabel(quantity)
        axes.grid(alpha=0.3)
    figure.axes[0].legend(fontsize="small", ncols=3)
    figure.axes[0].set_title(f"Predicted {AHEAD_S:g} s ahead")
    figure.axes[-1].set_xlabel("time [s]")
    figure.tight_layout()
