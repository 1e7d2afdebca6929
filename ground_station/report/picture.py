"""Pictures of a flight: positions, errors, formation as in the paper's figure 3, latency by stage."""

import io
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rcopterx.ground_station.colours import hex_colour
from rcopterx.ground_station.events import LoggedEvent
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.latency import STAGES
from rcopterx.vehicles.state import Array

FLIGHT_SIZE: Final = (11.0, 6.5)
POINTS: Final = 300  # most points of a line; more are not visible
COORDINATES: Final = {
    "x": ("black", 1000.0), "y": ("red", 1000.0), "z": ("blue", 1000.0), "heading": ("green", 100.0),
}  # fmt: skip
"""Colours and scales of the paper: millimetres, and radians magnified by 100."""
PLANS: Final = 12  # plans drawn of each vehicle


def svg_of(name: str, size: tuple[float, float], draw: Callable[..., None], *data: Any) -> str:
    """Picture as an SVG element, `size` in inches; `draw` is called with an empty figure and the data."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    # Text stays text; identifiers of elements depend on the name, so that a page can have many pictures.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "font.size": 8}):
        figure = Figure(figsize=size)
        draw(figure, *data)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None}, bbox_inches="tight")
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def flight_svg(
    name: str, names: Sequence[str], figures: FlightFigures, events: Sequence[LoggedEvent] = ()
) -> str:
    """Motion, errors, plans, latencies and events of vehicles as SVG; `name` is unique on the page."""
    return svg_of(name, FLIGHT_SIZE, _draw_flight, names, figures, events)


def _draw_flight(
    figure: Any, names: Sequence[str], figures: FlightFigures, events: Sequence[LoggedEvent]
) -> None:
    colours = {name: hex_colour(number) for number, name in enumerate(names)}
    grid = figure.add_gridspec(4, 3, width_ratios=(1.6, 1.6, 1.2))
    first: Any = None
    for row, label in enumerate(("x [m]", "y [m]", "z [m]")):
        axes = figure.add_subplot(grid[row, :2], sharex=first)
        first = first or axes
        for name in names:
            _draw_coordinate(axes, figures, name, row, colours[name])
        axes.set_ylabel(label)
        axes.tick_params(labelbottom=False)
    first.set_title("flown (solid) and reference (dashed)")
    errors = figure.add_subplot(grid[3, :2], sharex=first)
    for name in names:
        frames, errors_m = figures.tracking_errors(name)
        _plot(errors, _times_s(figures, frames), 1000 * errors_m, colours[name], lw=0.9)
    for event in events:
        errors.axvline(event.time_s, color="red" if event.alarming else "0.8", lw=0.6, zorder=0)
    errors.set_ylabel("error [mm]")
    errors.set_xlabel("time [s]")
    _draw_from_above(figure.add_subplot(grid[:3, 2]), figures, names, colours)
    _draw_latencies(figure.add_subplot(grid[3, 2]), figures)
    for axes in figure.axes:
        axes.grid(alpha=0.3)
    figure.tight_layout()


def _plot(axes: Any, x: Array, y: Array, colour: str, **style: Any) -> None:
    """Draw a line with at most about `POINTS` points."""
    step = max(1, len(x) // POINTS)
    axes.plot(x[::step], y[::step], colour, **style)


def _times_s(figures: FlightFigures, frames: NDArray[Any]) -> Array:
    return np.asarray((frames - figures.first_frame()) * figures.frame_period_s())


def _draw_coordinate(axes: Any, figures: FlightFigures, name: str, row: int, colour: str) -> None:
    frames, flown = figures.flown(name)
    _plot(axes, _times_s(figures, frames), flown[:, row], colour, lw=1, label=name)
    wanted_frames, wanted = figures.references(name)
    _plot(axes, _times_s(figures, wanted_frames), wanted[:, row], colour, lw=0.8, ls="--")


def _draw_from_above(
    axes: Any, figures: FlightFigures, names: Sequence[str], colours: dict[str, str]
) -> None:
    for name in names:
        _, flown = figures.flown(name)
        _plot(axes, flown[:, 0], flown[:, 1], colours[name], lw=1, label=name)
        if len(flown):
            axes.plot(flown[-1, 0], flown[-1, 1], "o", color=colours[name], ms=5)
        plans = figures.plans[name]
        for plan in plans[:: max(1, len(plans) // PLANS)]:
            stages = plan.trajectory.to_numpy()[::5]
            axes.plot(stages[:, 0], stages[:, 1], colours[name], lw=0.5, alpha=0.6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title("from above; thin: plans")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.legend(loc="upper right", fontsize="small")


def _draw_latencies(axes: Any, figures: FlightFigures) -> None:
    for label, values in (
        ("pose to command", figures.pose_to_command_ms()),
        ("frame to radio", figures.frame_to_radio_ms()),
    ):
        if values:
            top = float(np.percentile(values, 99.5))
            axes.hist(np.clip(values, 0, top), bins=40, histtype="step", label=label)
    axes.set_xlabel("latency [ms]")
    axes.set_ylabel("periods")
    if axes.patches:
        axes.legend(fontsize="small")


def formation_svg(name: str, names: Sequence[str], figures: FlightFigures) -> str:
    """Offsets of vehicles from their leaders, as in figure 3 of the paper; empty without followers."""
    pairs = [(follower, leader) for follower in names for leader in figures.followed(follower)]
    if not pairs:
        return ""
    size = (11.0, 1.9 * (len(pairs) + 1) + 0.6)
    return svg_of(f"{name} formation", size, _draw_formation, pairs, figures)


def _draw_formation(figure: Any, pairs: Sequence[tuple[str, str]], figures: FlightFigures) -> None:
    rows = figure.subplots(len(pairs) + 1, 1, sharex=True, squeeze=False)[:, 0]
    leader = pairs[0][1]
    frames, flown = figures.flown(leader)
    flown[:, 3] = np.unwrap(flown[:, 3])
    _draw_four(rows[0], _times_s(figures, frames), flown, "-")
    wanted_frames, wanted = figures.references(leader)
    _draw_four(rows[0], _times_s(figures, wanted_frames), wanted, "--")
    rows[0].set_ylabel(leader)
    for axes, (follower, followed) in zip(rows[1:], pairs, strict=True):
        frames, apart, meant = figures.offsets_m(follower, followed)
        times_s = _times_s(figures, frames)
        _draw_four(axes, times_s, apart, "-")
        _draw_four(axes, times_s, meant, "--")
        axes.set_ylabel(f"{followed} to {follower}")
    for axes in rows:
        axes.grid(alpha=0.3)
    rows[0].set_title("[mm, heading in 0.01 rad]; flown (solid) and wanted (dashed)")
    rows[0].legend(COORDINATES, ncols=4, fontsize="small", loc="upper right")
    rows[-1].set_xlabel("time [s]")
    figure.tight_layout()


def _draw_four(axes: Any, times_s: Array, values: Array, style: str) -> None:
    """Position and heading in the colours and scales of the paper."""
    for column, (colour, scale) in enumerate(COORDINATES.values()):
        _plot(axes, times_s, scale * values[:, column], colour, ls=style, lw=0.9)


def latency_svg(name: str, vehicle: str, figures: FlightFigures, started_s: float) -> str:
    """Stacked time that the commands of a vehicle spent in each stage; the axis begins at `started_s`."""
    rows = figures.stages[vehicle]
    if not (stages := [stage for stage in STAGES if rows and all(stage in times for _, times in rows)]):
        return ""
    return svg_of(f"{name} latency {vehicle}", (11.0, 2.6), _draw_stages, vehicle, stages, rows, started_s)


def _draw_stages(
    figure: Any,
    vehicle: str,
    stages: Sequence[str],
    rows: Sequence[tuple[float, dict[str, float]]],
    started_s: float,
) -> None:
    axes = figure.subplots()
    per_bin = max(1, -(-len(rows) // POINTS))
    groups = [rows[start : start + per_bin] for start in range(0, len(rows), per_bin)]
    times = [group[0][0] - started_s for group in groups]
    medians = [[float(np.median([row[stage] for _, row in group])) for group in groups] for stage in stages]
    axes.stackplot(times, medians, labels=stages, alpha=0.8)
    longest = [max(sum(row[stage] for stage in stages) for _, row in group) for group in groups]
    axes.plot(times, longest, color="black", lw=0.6, label="longest of all together")
    axes.set_ylabel(f"{vehicle} [ms]")
    axes.set_xlabel("time [s]")
    axes.set_title(f"latency by stage, medians of {per_bin} commands")
    axes.legend(ncols=len(stages) + 1, fontsize="x-small", loc="upper right")
    axes.grid(alpha=0.3)
