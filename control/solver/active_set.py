"""Newton's method for the piecewise quadratic cost: each sweep penalises an excess with weight s."""

from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import FLAG, MATRIX, compiled, part, record
from rcopterx.control.solver.problem import PROBLEM, TRAJECTORIES, OptimalControlProblem, Trajectories
from rcopterx.control.solver.sweep import FACTOR, Factor, factorize, solve
from rcopterx.vehicles.state import Array

TOLERANCE: Final = 1e-12  # of a change between active and inactive; times `HARD` a derivative of 1e-4
MOST_SWEEPS: Final = 8  # sweeps after which an iteration that has not converged is given up


class ActiveSet(NamedTuple):
    """Active bounds of all rows, and what they add to a sweep; arrays of shape (N, ny)."""

    side: Array  # 1 where the upper bound is active, -1 where the lower one is, 0 elsewhere
    e: Array  # weights
    target: Array

    @classmethod
    def empty(cls, stages: int, rows: int) -> "ActiveSet":
        """Return a set without active bounds."""
        return cls(*np.zeros((3, stages, rows)))


ACTIVE_SET: Final[Any] = record(ActiveSet, *3 * [MATRIX])


@compiled(PROBLEM, MATRIX, MATRIX)
def update_active_set(p: OptimalControlProblem, y: Array, side: Array) -> int:
    """Set the active bounds of a plan's rows; return how many changed."""
    changed = 0
    for k in range(y.shape[0]):
        for row in range(y.shape[1]):
            before = side[k, row]
            after = 0.0
            if p.s[k, row] > 0.0:
                if y[k, row] > p.high[k, row] + (-TOLERANCE if before > 0.0 else TOLERANCE):
                    after = 1.0
                elif y[k, row] < p.low[k, row] - (-TOLERANCE if before < 0.0 else TOLERANCE):
                    after = -1.0
            if after != before:
                side[k, row] = after
                changed += 1
    return changed


@part
def set_penalties(p: OptimalControlProblem, a: ActiveSet) -> bool:
    """Set the penalty weights and targets of active bounds; return whether any bound is active."""
    any_active = False
    for k in range(a.side.shape[0]):
        for row in range(a.side.shape[1]):
            a.e[k, row] = a.target[k, row] = 0.0
            if a.side[k, row] != 0.0:
                a.e[k, row] = p.s[k, row]
                a.target[k, row] = p.high[k, row] if a.side[k, row] > 0.0 else p.low[k, row]
                any_active = True
    return any_active


@compiled(PROBLEM, ACTIVE_SET, FACTOR, FACTOR, FLAG, TRAJECTORIES)
def iterate_active_set(
    p: OptimalControlProblem, a: ActiveSet, free: Factor, bounded: Factor, factored: bool, plan: Trajectories
) -> tuple[int, bool, bool]:
    """Sweep until the active set stays; return the number of sweeps, whether it did, and of `free`.

    `free` and `bounded` are factors without and with active bounds; `factored` if `free` is this problem's.
    """
    for sweep in range(1, MOST_SWEEPS + 1):
        if set_penalties(p, a):
            factorize(p, a.e, bounded)
            solve(p, a.e, a.target, bounded, plan)
        else:
            if not factored:
                factorize(p, a.e, free)
                factored = True
            solve(p, a.e, a.target, free, plan)
        if update_active_set(p, plan.y, a.side) == 0:
            return sweep, True, factored
    return MOST_SWEEPS, False, factored
