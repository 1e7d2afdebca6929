"""Which bounds are active: rows beyond a bound get the weight s and the bound for a target, others lose them.

This is Newton's method for the piecewise quadratic cost of the problem.
"""

from typing import Final

from rcopterx.compiling.compiled import MATRIX, compiled
from rcopterx.control.solver.problem import PROBLEM, OptimalControlProblem
from rcopterx.vehicles.state import Array

TOLERANCE: Final = 1e-12
"""A row changes between active and inactive by more than this; times `HARD` it is a derivative of 1e-4."""


@compiled(PROBLEM, MATRIX, MATRIX)
def update_active_set(p: OptimalControlProblem, y: Array, active: Array) -> int:
    """Set the active bounds of a plan's rows, shape (N, ny); return how many changed."""
    changed = 0
    for k in range(y.shape[0]):
        for row in range(y.shape[1]):
            before = active[k, row]
            after = 0.0
            if p.s[k, row] > 0.0:
                if y[k, row] > p.high[k, row] + (-TOLERANCE if before > 0.0 else TOLERANCE):
                    after = 1.0
                elif y[k, row] < p.low[k, row] - (-TOLERANCE if before < 0.0 else TOLERANCE):
                    after = -1.0
            if after != before:
                active[k, row] = after
                changed += 1
    return changed


@compiled(PROBLEM, MATRIX, MATRIX, MATRIX)
def set_pulls(p: OptimalControlProblem, active: Array, e: Array, target: Array) -> None:
    """Set weights and targets of the active rows; zero elsewhere."""
    for k in range(active.shape[0]):
        for row in range(active.shape[1]):
            e[k, row] = target[k, row] = 0.0
            if active[k, row] != 0.0:
                e[k, row] = p.s[k, row]
                target[k, row] = p.high[k, row] if active[k, row] > 0.0 else p.low[k, row]
