"""Figure of the formation experiment, laid out like the paper's Fig. 3: one column per scheme."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from rcopterx.experiments.record import FlightRecord
from rcopterx.vehicles.state import Array

COLOURS: Final = {"x": "black", "y": "tab:red", "z": "tab:blue", "psi": "tab:green"}
MILLIMETRES: Final = 1000.0
YAW_MAGNIFICATION: Final = 100.0
"""Headings are drawn in hundredths of a radian, as in the paper."""


def draw_formation(records: Mapping[str, FlightRecord], figure: Any) -> None:
    """Draw flights by title side by side: the leader, the distances to it, and between the followers."""
    figure.set_size_inches(7.5 * len(records), 12)
    axes = figure.subplots(4, len(records), sharex=True, sharey="row", squeeze=False)
    for column, (title, record) in enumerate(records.items()):
        leader, second, third = (record[name] for name in ("h1", "h2", "h3"))
        time_s = leader.time_s
        axes[0, column].set_title(title)
        _draw_four(axes[0, column], time_s, leader.motion[:, :4], leader.reference)
        for row, follower in ((1, second), (2, third)):
            gap, wanted = (
                states - leader.motion[:, :4] for states in (follower.motion[:, :4], follower.station)
            )
            _draw_four(axes[row, column], time_s, _without_turns(gap, wanted), wanted)
        between, wanted = (third.motion - second.motion)[:, :4], third.station - second.station
        _draw_four(axes[3, column], time_s, _without_turns(between, wanted), wanted)
        axes[3, column].set_xlabel("time [s]")
    for row, label in enumerate(("leader", "h1 to h2", "h1 to h3", "h2 to h3")):
        axes[row, 0].set_ylabel(f"{label} [mm, 0.01 rad]")
    axes[0, 0].legend(ncols=4, fontsize="small", loc="upper left")
    figure.suptitle("Set points (dashed) and flight (solid)")
    figure.tight_layout()


def _without_turns(flown: Array, wanted: Array) -> Array:
    """Differences between two vehicles without whole turns, which each of them counts by itself."""
    turns = np.round((flown[:, 3] - wanted[:, 3]) / (2 * np.pi))
    return np.column_stack((flown[:, :3], flown[:, 3] - 2 * np.pi * turns))


def _draw_four(axes: Any, time_s: Array, flown: Array, wanted: Array) -> None:
    """Draw position and heading."""
    for index, (name, colour) in enumerate(COLOURS.items()):
        scale = YAW_MAGNIFICATION if name == "psi" else MILLIMETRES
        axes.plot(time_s, scale * wanted[:, index], color=colour, linestyle="--", linewidth=0.8)
        axes.plot(time_s, scale * flown[:, index], color=colour, linewidth=1.0, label=name)
    axes.grid(alpha=0.3)
