"""How the simple schemes were given their settings for helicopters: each the best of a row of candidates.

The cascade's weights follow from its model by a rule. So that it is not compared with schemes that nobody
tuned for the vehicle, theirs are chosen here, on vehicles that no reported figure comes from. Horizontal
axes, height and heading are judged each by itself, so one flight tries a candidate for all three of them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from agents.controllers.paper_model import INPUT_WEIGHTS
from agents.controllers.pid import PidSettings
from experiments.events import GoTo
from experiments.record import rms
from experiments.rig import Progress, Rig
from experiments.runner import Options, Result, Tell, Work, run_all
from experiments.schemes import LQR, PAPER, PID, Scheme
from simulator.conditions import Conditions
from simulator.plant import Pose
from vehicles.state import YAW, Array
from vehicles.tuples import Three

HOME_M: Final[Three] = (0.0, 0.0, 1.0)
STEP: Final[tuple[Three, float]] = ((0.4, 0.3, 1.3), np.pi / 2)
SETTLED_S: Final = 4.0
STEP_S: Final = 10.0
RESTED_S: Final = 14.0
FLIGHT_S: Final = 17.0
"""Hover counts from 4 to 10 s; then a step of position and heading; what is left of it counts from 14 s."""
QUICK_FACTORS: Final = 2
LOST_M: Final = 0.5
AXES: Final = MappingProxyType({"horizontal": slice(0, 2), "height": slice(2, 3), "heading": slice(3, 4)})

Four = tuple[float, float, float, float]
Factors = Mapping[str, float]
"""What the weights or the bandwidth of each of `AXES` are multiplied by."""


def _four(factors: Factors) -> Array:
    return np.array([factors["horizontal"], factors["horizontal"], factors["height"], factors["heading"]])


def _times(values: Sequence[float], factors: Array) -> tuple[float, ...]:
    return tuple(np.round(np.array(values) * factors, 4).tolist())


def weighted(scheme: Scheme, factors: Factors) -> Scheme:
    """A linear-quadratic scheme with its input weights multiplied."""
    weights = _times(INPUT_WEIGHTS, _four(factors))
    return replace(scheme, settings={**scheme.settings, "input_weights": weights})


def faster(scheme: Scheme, factors: Factors) -> Scheme:
    """A PID with its bandwidth multiplied, damping ratios as they were."""
    usual, factor = PidSettings(), _four(factors)
    gains = {
        "proportional": _times(usual.proportional, factor**2),
        "damping": _times(usual.damping, factor),
        "integral": _times(usual.integral, factor[:3] ** 3),
    }
    return replace(scheme, settings={**scheme.settings, **gains})


@dataclass(frozen=True)
class Row:
    """Candidates of a scheme: how they are made of factors, and the factors of each of `AXES`."""

    scheme: Scheme
    made: Callable[[Scheme, Factors], Scheme]
    factors: Mapping[str, tuple[float, ...]]

    def candidate(self, index: int) -> Scheme:
        """The scheme with the factors of one place in the row."""
        return self.made(self.scheme, {axis: factors[index] for axis, factors in self.factors.items()})


WEIGHTS: Final = MappingProxyType(
    {
        "horizontal": (0.03, 0.1, 0.2, 0.5, 1.0),
        "height": (0.1, 0.3, 1.0, 3.0, 10.0),
        "heading": (3.0, 10.0, 30.0, 100.0, 300.0),
    }
)
BANDWIDTHS: Final = MappingProxyType(dict.fromkeys(AXES, (0.8, 1.0, 1.2, 1.4, 1.7)))
ROWS: Final = (Row(PAPER, weighted, WEIGHTS), Row(LQR, weighted, WEIGHTS), Row(PID, faster, BANDWIDTHS))


@dataclass(frozen=True)
class Flown:
    """Errors while at rest, shape (K, 4) [m, rad], and whether the vehicle was lost or met the floor."""

    errors: Array
    failed: bool


def fly_candidate(
    scheme: Scheme, conditions: Conditions, seed: int, progress: Progress | None = None
) -> Flown:
    """Hover, then a step."""
    rig = Rig([scheme.vehicle("h1", Pose(HOME_M), conditions, seed)], conditions, seed)
    record = rig.fly(FLIGHT_S, [GoTo(STEP_S, "h1", *STEP)], progress)["h1"]
    errors = record.motion[:, : YAW + 1] - record.reference
    time_s = record.time_s
    rows = ((time_s >= SETTLED_S) & (time_s < STEP_S)) | (time_s >= RESTED_S)
    away = not np.linalg.norm(errors[-1, :3]) < LOST_M
    return Flown(errors[rows], bool(record.left_volume or record.touchdowns or away))


def run(options: Options, tell: Tell) -> Result:
    """Fly every candidate on every seed.

    Returns
    -------
    Result
        Document: scheme -> axis -> error of each factor over all vehicles, and the settings that are best.
    """
    count = QUICK_FACTORS if options.quick else len(WEIGHTS["horizontal"])
    cases = list(product(ROWS, range(count), options.seeds))
    works = [
        Work(
            f"{row.scheme.name}, candidate {index + 1} of {count}, seed {seed}",
            partial(fly_candidate, row.candidate(index), options.conditions, seed),
        )
        for row, index, seed in cases
    ]
    flights = dict(
        zip(
            [(row.scheme.name, index, seed) for row, index, seed in cases],
            run_all(works, options.processes, tell),
            strict=True,
        )
    )
    document: dict[str, Any] = {}
    for row in ROWS:
        candidates = [
            [flights[row.scheme.name, index, seed] for seed in options.seeds] for index in range(count)
        ]
        document[row.scheme.name] = judged(row, candidates)
    return Result(document, partial(draw_tuning, document))


def judged(row: Row, candidates: Sequence[Sequence[Flown]]) -> dict[str, Any]:
    """Errors of every candidate [mm, mrad], and the settings made of the best factor of each axis."""
    failed = [sum(flown.failed for flown in flights) for flights in candidates]
    table: dict[str, Any] = {}
    best: dict[str, float] = {}
    for axis, columns in AXES.items():
        errors = [
            rms(np.concatenate([flown.errors[:, columns] for flown in flights])) for flights in candidates
        ]
        factors = row.factors[axis]
        table[axis] = {
            f"{factor:g}": round(1000 * error, 2) for factor, error in zip(factors, errors, strict=False)
        }
        order = sorted(range(len(errors)), key=lambda index: (failed[index], errors[index]))
        best[axis] = factors[order[0]]
    table["failed"] = {str(index + 1): count for index, count in enumerate(failed)}
    table["best_factors"] = best
    settings = row.made(row.scheme, best).settings
    table["settings"] = {name: settings[name] for name in settings.keys() - row.scheme.settings.keys()}
    return table


def draw_tuning(document: Mapping[str, Mapping[str, Mapping[str, float]]], figure: Any) -> None:
    """Draw the errors of every axis over the factors.

    Parameters
    ----------
    document
        As `run` returns it.
    figure
        Empty `matplotlib.figure.Figure`.
    """
    figure.set_size_inches(11, 4)
    for axes, axis in zip(figure.subplots(1, len(AXES)), AXES, strict=True):
        for scheme, table in document.items():
            axes.plot(
                [float(factor) for factor in table[axis]], list(table[axis].values()), "o-", label=scheme
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("factor of input weight (PID: bandwidth)")
        axes.set_title(axis)
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("rms error [mm, mrad]")
    figure.axes[0].legend(fontsize="small")
    figure.tight_layout()
