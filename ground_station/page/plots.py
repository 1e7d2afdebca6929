"""Plots of the last minute of one vehicle."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import viser
from viser import uplot

from rcopterx.ground_station.page.history import KEPT_S, History

HEIGHT_PX: Final = 170
RED: Final = "#d62728"
GREEN: Final = "#2ca02c"
BLUE: Final = "#1f77b4"
VIOLET: Final = "#9467bd"
PLOTS: Final[Mapping[str, tuple[tuple[str, str, str, bool], ...]]] = {
    "position and reference (dashed) [m]": (
        ("x_m", "x", RED, False), ("reference_x_m", "x ref.", RED, True),
        ("y_m", "y", GREEN, False), ("reference_y_m", "y ref.", GREEN, True),
        ("z_m", "z", BLUE, False), ("reference_z_m", "z ref.", BLUE, True),
    ),
    "distance from the reference [mm]": (("error_mm", "error", RED, False),),
    "sticks [-1 to 1]": (
        ("pitch", "pitch", RED, False), ("roll", "roll", GREEN, False),
        ("thrust", "thrust", BLUE, False), ("yaw", "yaw", VIOLET, False),
    ),
    "solver time, median [ms]": (("solve_ms", "solver", BLUE, False),),
}  # fmt: skip
"""Lines by title of the plot: quantity, legend, colour and whether it is dashed."""


class Plots:
    """Plots of one of several vehicles, in the open container of the server."""

    def __init__(self, server: viser.ViserServer, names: Sequence[str]) -> None:
        self.vehicle = server.gui.add_dropdown("vehicle", tuple(names), initial_value=names[0])
        self._plots = {title: _plot(server, title, lines) for title, lines in PLOTS.items()}

    def update(self, histories: Mapping[str, History]) -> None:
        """Show the chosen vehicle."""
        history = histories[self.vehicle.value]
        times_s = history.times_s
        if len(times_s) < 2:
            return
        before_now_s = times_s - times_s[-1]
        for title, lines in PLOTS.items():
            columns = (history.column(quantity) for quantity, *_ in lines)
            self._plots[title].data = (before_now_s, *columns)


def _plot(
    server: viser.ViserServer, title: str, lines: Sequence[tuple[str, str, str, bool]]
) -> "viser.GuiUplotHandle":
    series = [uplot.Series(label="time [s]")]
    for _, label, colour, dashed in lines:
        line = uplot.Series(label=label, stroke=colour, width=1.5)
        if dashed:
            line["dash"] = (4.0, 4.0)
        series.append(line)
    empty = tuple(np.zeros(2) for _ in series)
    return server.gui.add_uplot(
        empty,
        tuple(series),
        title=title,
        height=HEIGHT_PX,
        scales={"x": uplot.Scale(time=False, auto=False, range=(-KEPT_S, 0.0)), "y": uplot.Scale(auto=True)},
        legend=uplot.Legend(show=len(lines) > 1),
    )
