"""Mehrotra's predictor-corrector method on Riccati sweeps: slower than the active set, but it always ends.

Every bounded row has a slack t and a multiplier z on its upper and its lower side. Eliminating both leaves a
sweep with the barrier's weights e (J. Nocedal, S. Wright, Numerical Optimization, chapter 16.6).
"""

from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import BLOCKS, MATRIX, NUMBER, compiled, part, record
from rcopterx.control.solver.problem import PROBLEM, TRAJECTORIES, OptimalControlProblem, Trajectories
from rcopterx.control.solver.sweep import Factor, factorize, solve
from rcopterx.vehicles.state import Array

SMALLEST_START: Final = 0.1  # slacks begin at least so large
STIFFNESS: Final = 1e8  # weight of a hard bound here, over the curvature of the cost
TO_BOUNDARY: Final = 0.995  # share of the step to the boundary that is taken
FEASIBLE: Final = 1e-6


class Barrier(NamedTuple):
    """Slacks and multipliers of the rows, and their changes; first index: 0 upper side, 1 lower side."""

    t: Array  # slacks, shape (2, N, ny)
    z: Array  # multipliers, shape (2, N, ny)
    dt: Array
    dz: Array
    gap: Array  # residual of y + t = bound, shape (2, N, ny)
    e: Array  # weights of the sweep, shape (N, ny)
    target: Array  # targets of the sweep, shape (N, ny)
    s: Array  # weights of the bounds, finite, shape (N, ny)

    @classmethod
    def at(cls, p: OptimalControlProblem, y: Array, curvature: float) -> "Barrier":
        """Return a barrier that starts at the rows of a plan within hard bounds.

        Multipliers are at least those of the excesses over soft bounds, and their products with the slacks
        about equal. Rows without bounds have none.
        """
        bounded, hard = p.s > 0.0, np.isinf(p.s)
        s = np.where(hard, STIFFNESS * curvature, p.s)
        inside = np.where(bounded, (p.high - y, y - p.low), 1.0)
        t = np.maximum(inside, SMALLEST_START)
        z = np.where(bounded, np.maximum(np.where(hard, 0.0, s) * (t - inside), curvature), 0.0)
        z = np.where(bounded, np.maximum(z, (z * t)[:, bounded].mean() / t), 0.0)
        (dt, dz, gap), (e, target) = np.zeros((3, *t.shape)), np.zeros((2, *y.shape))
        return cls(t, z, dt, dz, gap, e, target, s)


BARRIER: Final[Any] = record(Barrier, *5 * [BLOCKS], *3 * [MATRIX])


@compiled(PROBLEM, TRAJECTORIES, BARRIER)
def residuals(p: OptimalControlProblem, plan: Trajectories, b: Barrier) -> tuple[float, float]:
    """Set the gaps; return the mean complementarity and the largest gap."""
    largest, products, count = 0.0, 0.0, 0
    for k in range(plan.y.shape[0]):
        for row in range(plan.y.shape[1]):
            s = b.s[k, row]
            if s == 0.0:
                continue
            y = plan.y[k, row]
            b.gap[0, k, row] = y - p.high[k, row] - b.z[0, k, row] / s + b.t[0, k, row]
            b.gap[1, k, row] = p.low[k, row] - y - b.z[1, k, row] / s + b.t[1, k, row]
            for side in range(2):
                largest = max(largest, abs(b.gap[side, k, row]))
                products += b.t[side, k, row] * b.z[side, k, row]
                count += 1
    return products / max(count, 1), largest


@part
def product(b: Barrier, side: int, k: int, row: int, centring: float) -> float:
    """Return what the product of a slack and its multiplier is to fall by; the changes are the last ones."""
    of_changes = b.dt[side, k, row] * b.dz[side, k, row]
    value: float = b.t[side, k, row] * b.z[side, k, row] + (of_changes - centring)
    return value


@compiled(MATRIX, BARRIER, NUMBER)
def set_barrier_weights(y: Array, b: Barrier, centring: float) -> None:
    """Set weights and targets of the sweep."""
    for k in range(y.shape[0]):
        for row in range(y.shape[1]):
            if b.s[k, row] == 0.0:
                continue
            weight = gradient = 0.0
            for side in range(2):
                t, z = b.t[side, k, row], b.z[side, k, row]
                scale = t + z / b.s[k, row]
                force = z + (z * b.gap[side, k, row] - product(b, side, k, row, centring)) / scale
                weight += z / scale
                gradient += force if side == 0 else -force
            b.e[k, row] = weight
            b.target[k, row] = y[k, row] - gradient / weight


@compiled(MATRIX, MATRIX, BARRIER, NUMBER)
def set_changes(y: Array, trial_y: Array, b: Barrier, centring: float) -> float:
    """Set the changes of slacks and multipliers by those of the rows; return the step to the boundary."""
    step = 1.0
    for k in range(y.shape[0]):
        for row in range(y.shape[1]):
            s = b.s[k, row]
            if s == 0.0:
                continue
            for side in range(2):
                t, z, gap = b.t[side, k, row], b.z[side, k, row], b.gap[side, k, row]
                change = trial_y[k, row] - y[k, row]
                toward = change if side == 0 else -change
                dz = (z * (toward + gap) - product(b, side, k, row, centring)) / (t + z / s)
                dt = -gap - toward + dz / s
                b.dz[side, k, row], b.dt[side, k, row] = dz, dt
                if dz < 0.0:
                    step = min(step, -z / dz)
                if dt < 0.0:
                    step = min(step, -t / dt)
    return step


@compiled(BARRIER, NUMBER)
def remaining(b: Barrier, step: float) -> float:
    """Share of the complementarity that is left after a part of the changes."""
    before = after = 0.0
    for side in range(b.t.shape[0]):
        for k in range(b.t.shape[1]):
            for row in range(b.t.shape[2]):
                t, z = b.t[side, k, row], b.z[side, k, row]
                before += t * z
                after += (t + step * b.dt[side, k, row]) * (z + step * b.dz[side, k, row])
    return after / before


def iterate(
    p: OptimalControlProblem,
    plan: Trajectories,
    trial: Trajectories,
    f: Factor,
    b: Barrier,
    complementarity: float,
) -> None:
    """Do one predictor-corrector step; `plan` satisfies the dynamics before and after it."""
    b.dt[:] = b.dz[:] = 0.0
    set_barrier_weights(plan.y, b, 0.0)
    factorize(p, b.e, b.target, f)
    solve(p, b.e, b.target, f, trial)
    step = set_changes(plan.y, trial.y, b, 0.0)
    # The corrector adds the products of the predictor's changes.
    centring = remaining(b, step) ** 3 * complementarity
    set_barrier_weights(plan.y, b, centring)
    solve(p, b.e, b.target, f, trial)
    step = min(1.0, TO_BOUNDARY * set_changes(plan.y, trial.y, b, centring))
    for values, targets in zip(plan, trial, strict=True):
        values += step * (targets - values)
    for values, changes in ((b.t, b.dt), (b.z, b.dz)):
        values += step * changes


def active_rows(p: OptimalControlProblem, b: Barrier, curvature: float) -> Array:
    """Return the soft bounds that are exceeded and the hard ones that are pressed on, as `ActiveSet.side`."""
    pressing = b.z > np.where(np.isinf(p.s), curvature, p.s) * b.t
    return np.asarray(pressing[0].astype(float) - pressing[1])
