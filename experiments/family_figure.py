"""Figure of the family experiment: distributions over the vehicles."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from rcopterx.experiments.figures import finish_figure

LevelName = tuple[str, str]
"""Knowledge of the pilot, and what the Tracker measures."""

TARGETS_MM: Final[Mapping[LevelName, tuple[float, float]]] = MappingProxyType(
    {
        ("default", "tilt measured"): (22.0, 40.0),
        ("default", "positions only"): (25.0, 50.0),
        ("identified", "tilt measured"): (12.0, 22.0),
        ("identified", "positions only"): (14.0, 28.0),
        ("exact", "tilt measured"): (9.0, 16.0),
        ("exact", "positions only"): (11.0, 20.0),
    }
)
"""Targets of hover: median and worst vehicle."""
PANELS: Final = MappingProxyType(
    {
        "hover_mm": "hover: rms error of the worse horizontal axis [mm]",
        "eight_mm": "figure-eight: rms distance from the path's present point [mm]",
    }
)


def draw_family(figures: Mapping[LevelName, Mapping[str, Sequence[float]]], preset: str, figure: Any) -> None:
    """Draw cumulative distributions over the vehicles, and the targets of hover.

    `figures` has one value per vehicle, by level and name.
    """
    figure.set_size_inches(11, 4.5)
    for axes, (name, label) in zip(figure.subplots(1, len(PANELS), sharey=True), PANELS.items(), strict=True):
        for index, (level, values) in enumerate(figures.items()):
            ordered = np.sort(values[name])
            share = np.arange(1, len(ordered) + 1) / len(ordered)
            axes.step(
                ordered, share, where="post", color=f"C{index}", label=f"{', '.join(level)} ({len(ordered)})"
            )
            if name == "hover_mm":
                axes.plot(
                    TARGETS_MM[level], (0.5, 1.0), "o", color=f"C{index}", fillstyle="none", clip_on=False
                )
        axes.set_xlabel(label)
        axes.set_xlim(left=0.0)
    figure.axes[0].set_ylabel("part of the vehicles")
    figure.axes[0].legend(fontsize="small", loc="lower right", title="circles: targets of median and worst")
    finish_figure(figure, f"Vehicles drawn from the family, conditions `{preset}`")
