"""Flying trajectories from the command line: circles, figure eights, spirals, waypoints from a file."""

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument

from rcopterx.commands.fleet_option import RunningFleetOption, running_fleet
from rcopterx.commands.output import PlotOption, write_plot
from rcopterx.commands.parsing import check_known, three
from rcopterx.commands.steer import Vehicle
from rcopterx.user_text import Row, TextError, number_in, rows_of, text_of

if TYPE_CHECKING:
    from rcopterx.control.references.paths import FlightPath

COLUMNS = ["t", "x", "y", "z", "yaw"]
SHAPES = ("circle", "figure-eight", "spiral", "waypoints")


def trajectory(
    vehicle: Vehicle,
    shape: Annotated[str, Argument(metavar="SHAPE", help=f"One of {', '.join(SHAPES)}.")],
    file: Path | None = None,
    center: str = "0,0,1",
    radius: float = 0.5,
    end_radius: float | None = None,
    climb: float | None = None,
    period: float = 8.0,
    turns: float = 1.0,
    heading: str = "fixed",
    wait: bool = False,
    plot: PlotOption = None,
    fleet: RunningFleetOption = None,
) -> None:
    """Fly a trajectory with a vehicle that leads; its followers keep their offsets.

    With --plot it is drawn instead of flown.
    """
    from rcopterx.control.references.path_shapes import circle, figure_eight, spiral, through
    from rcopterx.control.references.paths import PathError

    check_known([shape], SHAPES, "shape", "SHAPE")
    if shape != "waypoints" and file is not None:
        raise typer.BadParameter("only waypoints need a file", param_hint="FILE")
    if shape != "spiral" and (end_radius is not None or climb is not None):
        raise typer.BadParameter("are only for a spiral", param_hint="--end-radius, --climb")
    middle = three(center)
    try:
        if shape == "circle":
            path = circle(middle, radius, period, turns, heading)
        elif shape == "figure-eight":
            path = figure_eight(middle, (radius, 0.5 * radius), period, turns, heading)
        elif shape == "spiral":
            ends = (radius, radius if end_radius is None else end_radius)
            path = spiral(middle, ends, climb or 0.0, period, turns, heading)
        else:
            path = through(_waypoints(file))
    except PathError as error:
        raise typer.BadParameter(str(error)) from None
    if plot is not None:
        write_plot(partial(_draw, path), plot)
        typer.echo(f"{path.duration_s:.1f} s")
        return
    with running_fleet(fleet, [vehicle]) as running:
        typer.echo(f"{vehicle}: {running[vehicle].fly(path, wait)}")


def _waypoints(file: Path | None) -> list[list[float]]:
    if file is None:
        raise typer.BadParameter("waypoints need a CSV file with columns t,x,y,z,yaw", param_hint="FILE")
    try:
        return [_waypoint(row) for row in rows_of(text_of(file)) if row.cells != COLUMNS]
    except OSError as error:
        raise typer.BadParameter(f"{file}: {error.strerror}", param_hint="FILE") from None
    except TextError as error:
        raise typer.BadParameter(f"{file}, {error}", param_hint="FILE") from None


def _waypoint(row: Row) -> list[float]:
    if len(row.cells) != len(COLUMNS):
        words = f"{','.join(row.cells)!r} is not {','.join(COLUMNS)}"
        raise TextError(f"line {row.line}: {words}; decimals have a point")
    t, x, y, z, yaw = (number_in(cell, f"line {row.line}") for cell in row.cells)
    return [t, x, y, z, math.radians(yaw)]


def _draw(path: "FlightPath", figure: Any) -> None:
    import numpy as np

    times = np.arange(0.0, path.duration_s, 0.02)
    samples = path.sample(times)
    figure.set_size_inches(9, 4)
    above, course = figure.subplots(1, 2)
    above.plot(samples[:, 0], samples[:, 1])
    above.plot(*samples[0, :2], "o")
    above.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    course.plot(times, np.linalg.norm(samples[:, 4:7], axis=1), label="speed [m/s]")
    course.plot(times, samples[:, 2], label="z [m]")
    course.set(xlabel="time [s]")
    course.legend()
    figure.tight_layout()
