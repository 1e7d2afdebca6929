"""Fleet files from files of other software: `import`, `import-skybrush`."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

import tomlkit
import typer
from typer import Argument, Option

from rcopterx.commands.new_lab import HIGH, LOW, NewFleetFile
from rcopterx.commands.parsing import three
from rcopterx.deploy.new_laboratory import NewLaboratory, NewVehicle, name_of, write_fleet_file

import_ = typer.Typer(add_completion=False, no_args_is_help=True)
skybrush = typer.Typer(add_completion=False)

PANEL: Final = "Prepare a laboratory"
TRACKER: Final = "127.0.0.1:18801"  # address of the simulated Tracker
SPACING_M: Final = 0.6  # between vehicles that stand on the floor
MOTION_CAPTURE: Final = "motion_capture.yaml"

LowerCorner = Annotated[
    str, Option("--volume-min", metavar="X,Y,Z", help="Lower corner of the flight volume in metres.")
]
UpperCorner = Annotated[
    str, Option("--volume-max", metavar="X,Y,Z", help="Upper corner of the flight volume in metres.")
]


@import_.callback(rich_help_panel=PANEL)
def _import() -> None:
    """Write a fleet file from files of other software."""


@import_.command()
def crazyswarm2(
    source: Annotated[
        Path, Argument(metavar="CRAZYFLIES", exists=True, dir_okay=False, help="File crazyflies.yaml.")
    ],
    file: NewFleetFile,
    motion_capture: Annotated[
        Path | None, Option(metavar="FILE", help=f"Default: {MOTION_CAPTURE} beside the other one.")
    ] = None,
    rate_hz: Annotated[
        float | None,
        Option("--rate", metavar="HZ", help="Capture rate; only a Vicon Tracker reports its own."),
    ] = None,
    volume_min: LowerCorner = LOW,
    volume_max: UpperCorner = HIGH,
) -> None:
    """Write the fleet file of the enabled Crazyflies of Crazyswarm2, with their motion capture."""
    from rcopterx_studies.importing.crazyswarm import read_tracker, read_vehicles

    remarks: list[str] = []
    vehicles = read_vehicles(source, remarks)
    brand, address = read_tracker(motion_capture or source.with_name(MOTION_CAPTURE), remarks)
    name, corners = name_of(file.stem), (three(volume_min), three(volume_max))
    write_fleet_file(file, NewLaboratory(name, address, *corners, vehicles, brand, rate_hz))
    for remark in remarks:
        typer.echo(f"remark: {remark}", err=True)
    typer.echo(f"{file}: {', '.join(one.name for one in vehicles)}; its first lines list the next steps")


@skybrush.command(rich_help_panel=PANEL)
def import_skybrush(
    show: Annotated[
        Path, Argument(metavar="SHOW", exists=True, dir_okay=False, help="File .skyc, or a zip of CSV files.")
    ],
    file: NewFleetFile,
    volume_min: LowerCorner = LOW,
    volume_max: UpperCorner = HIGH,
) -> None:
    """Write the fleet file of a simulated vehicle for each drone of a show of Skybrush."""
    from rcopterx_studies.importing.skybrush import read_vehicles

    vehicles = read_vehicles(show)
    name, low_m, high_m = name_of(file.stem), three(volume_min), three(volume_max)
    simulator = _simulator_text(vehicles, low_m, high_m)
    laboratory = NewLaboratory(name, TRACKER, low_m, high_m, vehicles, simulator=simulator)
    write_fleet_file(file, laboratory)
    typer.echo(f"{file}: {len(vehicles)} vehicles; fly the show: examples/light_show --fleet {file}")


def _simulator_text(
    vehicles: Sequence[NewVehicle], low_m: tuple[float, float, float], high_m: tuple[float, float, float]
) -> str:
    """Sections of the simulator; the vehicles stand in rows in the middle of the volume."""
    columns = math.ceil(math.sqrt(len(vehicles)))
    corner_m = [
        round(0.5 * (low_m[axis] + high_m[axis] - SPACING_M * (lines - 1)), 3)
        for axis, lines in enumerate((columns, math.ceil(len(vehicles) / columns)))
    ]
    places = []
    for number, vehicle in enumerate(vehicles):
        row, column = divmod(number, columns)
        x, y = corner_m[0] + SPACING_M * column, corner_m[1] + SPACING_M * row
        places.append(f"{tomlkit.key(vehicle.name).as_string()} = [{x:.2f}, {y:.2f}, 0.0, 0.0]")
    starts = "\n".join(places)
    return f"""\
# To fly hardware: remove the sections of the simulator, and give the address of the Tracker
# and the ports of the radios.
[simulator]
conditions = "helicopter"

[simulator.start]    # x, y, z in metres, heading in radians
{starts}
"""
