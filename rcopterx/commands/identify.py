"""Fitting the model of a vehicle to its own flight: `identify`."""

from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.experiment import check_plot
from rcopterx.commands.fleet_option import RunningFleetOption


def identify(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE")],
    seconds: Annotated[
        float, typer.Option(metavar="SECONDS", min=20, max=300, help="How long the sticks move.")
    ] = 70.0,
    strength: Annotated[
        float,
        typer.Option(metavar="FRACTION", min=0.1, max=2, help="Of the usual excitation; less is gentler."),
    ] = 1.0,
    reach: Annotated[
        float,
        typer.Option(metavar="METRES", min=0.1, max=2, help="It stops when further from its set point."),
    ] = 0.4,
    from_file: Annotated[
        Path | None, typer.Option("--from", metavar="FILE", help="Fit a recorded flight; nothing flies.")
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Keep the recording in this file (.npz).")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw measured and predicted (png, svg, pdf)."),
    ] = None,
    positions_only: Annotated[
        bool, typer.Option("--positions-only", help="Leave the measured roll and pitch out.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print the model and leave the fleet file alone.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Move the sticks of a hovering vehicle a little, fit its model, and write it into the fleet file.

    The vehicle hovers and follows nobody (rcopterx lead VEHICLE), with room around it.
    """
    check_plot(plot)
    from rcopterx.commands.identifying import Excitation, Outputs, identify_vehicle

    flight = from_file or Excitation(seconds, strength, reach)
    identify_vehicle(vehicle, fleet, flight, positions_only, Outputs(save, plot, dry_run, as_json))
