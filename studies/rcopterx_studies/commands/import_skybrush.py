"""The fleet file of a drone show: `import-skybrush`."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

import tomlkit
import typer
from typer import Argument

from rcopterx.commands.new_lab import LowerCorner, NewFleetFile, UpperCorner
from rcopterx.commands.parsing import three
from rcopterx.deploy.new_laboratory import NewLaboratory, NewVehicle, name_of, write_fleet_file

app = typer.Typer(add_completion=False)

TRACKER: Final = "127.0.0.1:18801"  # address of the simulated Tracker
SPACING_M: Final = 0.6  # between vehicles that stand on the floor


@app.command(rich_help_panel="Prepare a laboratory")
def import_skybrush(
    show: Annotated[
        Path, Argument(metavar="SHOW", exists=True, dir_okay=False, help="File .skyc, or a zip of CSV files.")
    ],
    file: NewFleetFile,
    volume_min: LowerCorner = "-1.5,-1.5,0",
    volume_max: UpperCorner = "1.5,1.5,2",
) -> None:
    """Write the fleet file of a simulated vehicle for each drone of a show of Skybrush."""
    from rcopterx_studies.skybrush import read_vehicles

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
