"""Settings of the simple schemes for helicopters, each the best of a row of candidates.

The cascade's weights follow from its model by a rule. For a fair comparison the settings of the other schemes
are chosen here, on vehicles that no reported figure comes from. The best candidate is the one whose worst
vehicle hovers best.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.control.controllers.paper.model import INPUT_WEIGHTS
from rcopterx.control.controllers.pid import PidSettings
from rcopterx.experiments.figures import finish_figure
from rcopterx.experiments.record import rms
from rcopterx.experiments.rig import Progress, Rig
from rcopterx.experiments.runner import Options, Result, ShowProgress, fly_seeds
from rcopterx.experiments.schemes import LQR, PAPER, PID, Scheme
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.state import YAW, Array

FLIGHT_S: Final = 20.0
QUICK_FLIGHT_S: Final = 7.0
SETTLED_S: Final = 6.0
"""Errors count from here on."""
AHEAD_M: Final = 0.1
"""Errors are those of a point this far ahead of the vehicle's centre, so that they include the heading's."""


@dataclass(frozen=True)
class Factors:
    """Factors of the input weights of the axes or, of the PID, of their bandwidths."""

    horizontal: float
    height: float
    heading: float

    def __str__(self) -> str:
        """As a key of the document."""
        return f"{self.horizontal:g}, {self.height:g}, {self.heading:g}"

    @property
    def four(self) -> Array:
        """For the sticks in their order."""
        return np.array([self.horizontal, self.horizontal, self.height, self.heading])


def _times(values: Sequence[float], factors: Array) -> tuple[float, ...]:
    return tuple(np.round(np.array(values) * factors, 4).tolist())


def weighted(scheme: Scheme, factors: Factors) -> Scheme:
    """A linear-quadratic scheme with its input weights multiplied."""
    weights = _times(INPUT_WEIGHTS, factors.four)
    return replace(scheme, settings={**scheme.settings, "input_weights": weights})


def faster(scheme: Scheme, factors: Factors) -> Scheme:
    """A PID with its bandwidth multiplied, damping ratios as they were."""
    usual, factor = PidSettings(), factors.four
    gains = {
        "proportional": _times(usual.proportional, factor**2),
        "damping": _times(usual.damping, factor),
        "integral": _times(usual.integral, factor[:3] ** 3),
    }
    return replace(scheme, settings={**scheme.settings, **gains})


@dataclass(frozen=True)
class Row:
    """Candidates of a scheme: `made` applies factors to it."""

    scheme: Scheme
    made: Callable[[Scheme, Factors], Scheme]
    factors: tuple[Factors, ...]


ROWS: Final = (
    Row(PAPER, weighted, (Factors(1, 1, 1), Factors(1, 1, 30), Factors(1, 1, 100), Factors(0.5, 1, 100))),
    Row(LQR, weighted, (Factors(1, 1, 1), Factors(0.5, 1, 100), Factors(0.2, 1, 100), Factors(0.1, 1, 30))),
    Row(
        PID, faster, (Factors(1, 1, 1), Factors(1.2, 1.4, 1), Factors(1.4, 1.4, 1.2), Factors(1.7, 1.7, 1.4))
    ),
)


def fly_candidate(
    scheme: Scheme, flight_s: float, conditions: Conditions, seed: int, progress: Progress | None = None
) -> float:
    """Hover; returns the root mean square error of the point ahead [mm]."""
    rig = Rig([scheme.vehicle("h1", Pose((0.0, 0.0, 1.0)), conditions, seed)], conditions, seed)
    record = rig.fly(flight_s, progress=progress)["h1"]
    errors = record.reference_error(SETTLED_S)
    errors[:, YAW] *= AHEAD_M
    return 1000 * rms(np.linalg.norm(errors, axis=1))


def run(options: Options, show: ShowProgress) -> Result:
    """Fly every candidate on every seed.

    Returns
    -------
    Result
        Document: scheme -> error of every candidate's median and worst vehicle [mm], the best, its settings.
    """
    flight_s = QUICK_FLIGHT_S if options.quick else FLIGHT_S
    flights = {
        f"{row.scheme.name} {factors}": partial(fly_candidate, row.made(row.scheme, factors), flight_s)
        for row in ROWS
        for factors in row.factors
    }
    flown = fly_seeds(flights, options, show)
    document = {
        row.scheme.name: judged(
            row,
            {factors: list(flown[f"{row.scheme.name} {factors}"].values()) for factors in row.factors},
        )
        for row in ROWS
    }
    return Result(document, partial(draw_tuning, document))


def judged(row: Row, errors_mm: Mapping[Factors, Sequence[float]]) -> dict[str, Any]:
    """Errors of every candidate, and the settings of the best."""
    best = min(errors_mm, key=lambda factors: max(errors_mm[factors]))
    settings = row.made(row.scheme, best).settings
    return {
        "errors_mm": {
            str(factors): {"median": round(float(np.median(errors)), 1), "worst": round(max(errors), 1)}
            for factors, errors in errors_mm.items()
        },
        "best": str(best),
        "settings": {name: settings[name] for name in settings if name not in row.scheme.settings},
    }


def draw_tuning(document: Mapping[str, Mapping[str, Any]], figure: Any) -> None:
    """Draw the median and worst error of every candidate."""
    figure.set_size_inches(11, 4)
    panels = figure.subplots(1, len(document), sharey=True)
    for axes, (scheme, table) in zip(panels, document.items(), strict=True):
        for which in ("median", "worst"):
            errors = [candidate[which] for candidate in table["errors_mm"].values()]
            axes.semilogy(list(table["errors_mm"]), errors, "o-", label=which)
        axes.set_title(scheme)
        axes.set_xlabel("factors: horizontal, height, heading")
    figure.axes[0].set_ylabel("rms error of a point 0.1 m ahead [mm]")
    figure.axes[0].legend(fontsize="small")
    finish_figure(figure)
