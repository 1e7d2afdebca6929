"""Picture of a flown manoeuvre: where the vehicles were, how far from their references, how late."""

import io
from typing import Any, Final

import numpy as np

from rcopterx.ground_station.report import FlightFigures
from rcopterx.vehicles.state import Array

COLOURS: Final = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown", "tab:pink")
POINTS: Final = 300
"""Most points of a line; more cannot be seen."""
PLANS: Final = 12
"""Plans drawn of each vehicle."""


def svg_of(report: dict[str, Any], figures: FlightFigures) -> str:
    """Picture of a flight as an SVG element that can stand in a page beside others.

    Parameters
    ----------
    report
        Table of the flight; names the vehicles.
    figures
        Figures of the same flight.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    # Texts stay texts, and what an element is called depends on the manoeuvre, so that pages can hold many.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": report["manoeuvre"], "font.size": 8}):
        figure = Figure(figsize=(11, 6.5))
        draw_flight(report, figures, figure)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None}, bbox_inches="tight")
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def draw_flight(report: dict[str, Any], figures: FlightFigures, figure: Any) -> None:
    """Draw a flight into an empty `matplotlib.figure.Figure`."""
    names = list(report["vehicles"])
    colours = {name: COLOURS[index % len(COLOURS)] for index, name in enumerate(names)}
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
        _draw_error(errors, figures, name, colours[name])
    errors.set_ylabel("error [mm]")
    errors.set_xlabel("time [s]")
    _draw_from_above(figure.add_subplot(grid[:3, 2]), figures, names, colours)
    _draw_latencies(figure.add_subplot(grid[3, 2]), figures)
    for axes in figure.axes:
        axes.grid(alpha=0.3)
    figure.tight_layout()


def _times(frames: Array, figures: FlightFigures, start: int) -> Array:
    return np.asarray((frames - start) * figures.frame_period_s())


def _thinned(values: Array) -> Array:
    return values[:: max(1, len(values) // POINTS)]


def _start(figures: FlightFigures, name: str) -> int:
    frames, _ = figures.flown(name)
    return int(frames[0]) if len(frames) else 0


def _references(figures: FlightFigures, name: str) -> tuple[Array, Array]:
    """Frames, shape (n,), and references, shape (n, 4), of the plans that have one."""
    plans = [plan for plan in figures.plans(name) if plan.reference is not None]
    frames = np.array([plan.frame for plan in plans], dtype=float)
    return frames, np.array([plan.reference for plan in plans], dtype=float).reshape(-1, 4)


def _draw_coordinate(axes: Any, figures: FlightFigures, name: str, row: int, colour: str) -> None:
    frames, flown = figures.flown(name)
    start = _start(figures, name)
    axes.plot(
        _thinned(_times(frames.astype(float), figures, start)),
        _thinned(flown[:, row]),
        colour,
        lw=1,
        label=name,
    )
    wanted_frames, wanted = _references(figures, name)
    axes.plot(
        _thinned(_times(wanted_frames, figures, start)), _thinned(wanted[:, row]), colour, lw=0.8, ls="--"
    )


def _draw_error(axes: Any, figures: FlightFigures, name: str, colour: str) -> None:
    """Distance from the reference of the same moment."""
    frames, flown = figures.flown(name)
    wanted_frames, wanted = _references(figures, name)
    if len(frames) < 2 or not len(wanted_frames):
        return
    starts = [plan.start_s for plan in figures.plans(name) if plan.reference is not None]
    meant = wanted_frames + np.round(np.array(starts) / figures.frame_period_s())
    inside = meant <= frames[-1]
    at = np.stack([np.interp(meant[inside], frames, flown[:, axis]) for axis in range(3)], axis=1)
    error_mm = 1000 * np.linalg.norm(at - wanted[inside, :3], axis=1)
    times = _times(meant[inside], figures, _start(figures, name))
    axes.plot(_thinned(times), _thinned(error_mm), colour, lw=0.9)


def _draw_from_above(axes: Any, figures: FlightFigures, names: list[str], colours: dict[str, str]) -> None:
    for name in names:
        _, flown = figures.flown(name)
        thin = _thinned(flown)
        axes.plot(thin[:, 0], thin[:, 1], colours[name], lw=1, label=name)
        if len(flown):
            axes.plot(flown[-1, 0], flown[-1, 1], "o", color=colours[name], ms=5)
        plans = figures.plans(name)
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
