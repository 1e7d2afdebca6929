"""Kernels that sample trajectories (`rcopterx.control.references.trajectory`)."""

import numpy as np

from rcopterx.compiling.compiled import ANY_MATRIX, ANY_VECTOR, MATRIX, NUMBER, Array, compiled, part
from rcopterx.control.references.columns import COLUMNS, X_ACCELERATION, X_RATE, YAW

ON_STAGE = 1e-6  # an instant so close to a stage, in periods, is on it


@part
def place_in_plan(at_s: float, plan_period_s: float, last: int) -> tuple[int, float, float, int]:
    """Locate an instant in a plan with stages 0 to `last`.

    Returns the stage before it, the share of the next one, the time [s] before (negative) or after the plan,
    and the stage at that end.
    """
    at = at_s / plan_period_s
    nearest = np.rint(at)
    if abs(at - nearest) < ON_STAGE:
        at = nearest
    inside = min(max(at, 0.0), float(last))
    lower = min(int(inside), max(last - 1, 0))
    return lower, inside - lower, (at - inside) * plan_period_s, last if at > inside else 0


@compiled(ANY_MATRIX, NUMBER, NUMBER, NUMBER, ANY_VECTOR, NUMBER, MATRIX)
def resample(
    samples: Array,
    plan_period_s: float,
    start_s: float,
    period_s: float,
    offset_m: Array,
    yaw_offset_rad: float,
    values: Array,
) -> None:
    """Set `values`, shape (N, 12), to a trajectory at instants from `start_s` on, displaced by an offset."""
    last = len(samples) - 1
    for stage in range(len(values)):
        lower, share, outside_s, end = place_in_plan(start_s + period_s * stage, plan_period_s, last)
        upper = min(lower + 1, last)
        for column in range(COLUMNS):
            values[stage, column] = samples[lower, column] * (1 - share) + samples[upper, column] * share
        if outside_s != 0.0:
            for column in range(X_RATE):
                values[stage, column] += outside_s * samples[end, X_RATE + column]
            if outside_s > 0.0 or outside_s <= -plan_period_s:
                for column in range(X_ACCELERATION, COLUMNS):
                    values[stage, column] = 0.0
        for axis in range(3):
            values[stage, axis] += offset_m[axis]
        values[stage, YAW] += yaw_offset_rad


@compiled(ANY_MATRIX, ANY_VECTOR, NUMBER)
def samples_through(positions: Array, end_rates: Array, period_s: float) -> Array:
    """Return samples of N stages through positions, shape (N, 4); rates are differences, but the last."""
    stages = len(positions)
    samples = np.empty((stages, COLUMNS))
    for axis in range(X_RATE):
        for k in range(stages):
            samples[k, axis] = positions[k, axis]
            if k < stages - 1:
                samples[k, X_RATE + axis] = (positions[k + 1, axis] - positions[k, axis]) / period_s
        samples[stages - 1, X_RATE + axis] = end_rates[axis]
        for k in range(stages - 1):
            change = samples[k + 1, X_RATE + axis] - samples[k, X_RATE + axis]
            samples[k, X_ACCELERATION + axis] = change / period_s
        samples[stages - 1, X_ACCELERATION + axis] = samples[stages - 2, X_ACCELERATION + axis]
    return samples
