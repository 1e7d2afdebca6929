"""Fitting the model of a vehicle to its own flight: `identify`."""

from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import RunningFleetOption
from rcopterx.commands.output import JsonOption, check_plot


def identify(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE")],
    seconds: Annotated[
        float, typer.Option(metavar="SECONDS", min=20, max=300, help="Duration of the excitation.")
    ] = 70.0,
    strength: Annotated[
        float,
        typer.Option(metavar="FRACTION", min=0.1, max=2, help="Fraction of the usual excitation."),
    ] = 1.0,
    reach: Annotated[
        float,
        typer.Option(
            metavar="METRES",
            min=0.1,
            max=2,
            help="Largest distance from the set point; beyond it the excitation stops.",
        ),
    ] = 0.4,
    from_file: Annotated[
        Path | None, typer.Option("--from", metavar="FILE", help="Fit a recorded flight instead of flying.")
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Save the recording in this file (.npz).")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw measured and predicted motion (png, svg, pdf)."),
    ] = None,
    positions_only: Annotated[
        bool, typer.Option("--positions-only", help="Ignore the measured roll and pitch.")
    ] = False,
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
    from rcopterx.commands.identifying import Excitation, Outputs, identify_vehicle

    flight = from_file or Excitation(seconds, strength, reach)
    identify_vehicle(vehicle, fleet, flight, positions_only, Outputs(save, plot, dry_run, as_json))
