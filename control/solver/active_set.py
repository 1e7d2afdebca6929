"""Newton's method for the piecewise quadratic cost, and the plan that is flown if a solver stops too early.

Each sweep penalises an excess with weight s. Active hard bounds fix their rows, and stay active as long as
their multipliers have the right sign.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import FLAG, MATRIX, NUMBER, compiled, part, record
from rcopterx.control.solver.problem import (
    PROBLEM,
    TRAJECTORIES,
    OptimalControlProblem,
    Solution,
    Trajectories,
)
from rcopterx.control.solver.sweep import (
    FACTOR,
    Factor,
    along_row,
    differentiate,
    factorize,
    quality,
    roll_out,
    solve,
)
from rcopterx.vehicles.state import Array

TOLERANCE: Final = 1e-12  # of a change between active and inactive
MOST_SWEEPS: Final = 8  # sweeps after which an iteration that has not converged is given up


class ActiveSet(NamedTuple):
    """Active bounds of all rows, and what they add to a sweep; arrays of shape (N, ny)."""

    side: Array  # 1 where the upper bound is active, -1 where the lower one is, 0 elsewhere
    e: Array  # weights; infinite for hard bounds
    target: Array

    @classmethod
    def empty(cls, stages: int, rows: int) -> "ActiveSet":
        """Return a set without active bounds."""
        return cls(*np.zeros((3, stages, rows)))


ACTIVE_SET: Final[Any] = record(ActiveSet, *3 * [MATRIX])


@compiled(PROBLEM, MATRIX, MATRIX)
def update_active_set(p: OptimalControlProblem, y: Array, side: Array) -> int:
    """Set the active bounds of a plan's rows, but keep hard ones that are active; return how many changed."""
    changed = 0
    for k in range(y.shape[0]):
        for row in range(y.shape[1]):
            before = side[k, row]
            if before != 0.0 and math.isinf(p.s[k, row]):
                continue
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
def release(p: OptimalControlProblem, plan: Trajectories, a: ActiveSet) -> int:
    """Release the hard bounds whose multipliers have the wrong sign; return how many."""
    released, force = 0, np.empty(plan.y.shape)
    derivative = np.empty(plan.u.shape)
    for k in range(plan.y.shape[0]):
        for row in range(plan.y.shape[1]):
            force[k, row] = p.W[k, row] * (plan.y[k, row] - p.r[k, row])
            if a.side[k, row] != 0.0 and not math.isinf(a.e[k, row]):
                force[k, row] += a.e[k, row] * (plan.y[k, row] - a.target[k, row])
    differentiate(p, plan, force, derivative)
    for k in range(plan.y.shape[0]):
        for row in range(plan.y.shape[1]):
            if math.isinf(a.e[k, row]) and a.side[k, row] * along_row(p, k, row, derivative[k]) > 0.0:
                a.side[k, row] = 0.0
                released += 1
    return released


@part
def set_penalties(p: OptimalControlProblem, a: ActiveSet) -> tuple[bool, bool]:
    """Set the weights and targets of active bounds; return whether any is active, and whether a hard one."""
    any_active = any_hard = False
    for k in range(a.side.shape[0]):
        for row in range(a.side.shape[1]):
            a.e[k, row] = a.target[k, row] = 0.0
            if a.side[k, row] != 0.0:
                a.e[k, row] = p.s[k, row]
                a.target[k, row] = p.high[k, row] if a.side[k, row] > 0.0 else p.low[k, row]
                any_active, any_hard = True, any_hard or math.isinf(p.s[k, row])
    return any_active, any_hard


OPTIMAL: Final = 1e-3  # largest residuals of an optimal plan: of a stick, and of a change of an input


@compiled(NUMBER, NUMBER)
def small(primal: float, dual: float) -> bool:
    """Whether residuals are those of an optimal plan; they are not where a number is not finite."""
    return primal < OPTIMAL and 0.0 <= dual < OPTIMAL


@compiled(PROBLEM, ACTIVE_SET, FACTOR, FACTOR, FLAG, TRAJECTORIES)
def iterate_active_set(
    p: OptimalControlProblem, a: ActiveSet, free: Factor, bounded: Factor, factored: bool, plan: Trajectories
) -> tuple[int, bool, bool]:
    """Sweep until the active set stays; return sweeps, whether the plan is optimal, and `factored`.

    `free` and `bounded` are factors without and with active bounds; `factored` if `free` is this problem's.
    """
    for sweep in range(1, MOST_SWEEPS + 1):
        any_active, any_hard = set_penalties(p, a)
        if any_active:
            factorize(p, a.e, a.target, bounded)
            solve(p, a.e, a.target, bounded, plan)
        else:
            if not factored:
                factorize(p, a.e, a.target, free)
                factored = True
            solve(p, a.e, a.target, free, plan)
        released = release(p, plan, a) if any_hard else 0
        if update_active_set(p, plan.y, a.side) + released == 0:
            _, primal, dual = quality(p, plan)
            return sweep, small(primal, dual), factored
    return MOST_SWEEPS, False, factored


def rated(
    p: OptimalControlProblem, plan: Trajectories, active: Array, iterations: int, converged: bool
) -> Solution:
    """Return a rated plan; `converged`: by the solver's own tolerances; others as of `Solution`."""
    _, primal, dual = quality(p, plan)
    return Solution(*plan, active, iterations, converged and small(primal, dual))


def best_plan(p: OptimalControlProblem, inputs: Array, last: Array | None) -> Trajectories:
    """Return the less costly of two plans within hard bounds: of inputs, and of the last ones, shifted."""
    known = [inputs] if last is None else [inputs, shift(last)]
    plans = [rolled_out(p, within_hard_bounds(p, candidate)) for candidate in known]
    return min(plans, key=lambda plan: float(np.nan_to_num(quality(p, plan)[0], nan=np.inf)))


def shift(stages: Array) -> Array:
    """Return values of stages one stage on; the last one is repeated."""
    return np.concatenate((stages[1:], stages[-1:]))


def rolled_out(p: OptimalControlProblem, inputs: Array) -> Trajectories:
    """Return what inputs lead to, shape (N, nu)."""
    plan = empty_plan(p)
    plan.u[:] = inputs
    roll_out(p, plan)
    return plan


def within_hard_bounds(p: OptimalControlProblem, inputs: Array) -> Array:
    """Return inputs whose hard rows, which depend on the inputs alone, are clipped to their bounds."""
    hard = np.isinf(p.s[0])
    D = p.D[:, hard]
    rows = np.einsum("kij,kj->ki", D, inputs)
    return np.linalg.solve(D, np.clip(rows, p.low[:, hard], p.high[:, hard])[..., None])[..., 0]


def empty_plan(p: OptimalControlProblem) -> Trajectories:
    """Return a plan to be filled."""
    stages, nx, nu = p.B.shape
    return Trajectories(np.empty((stages + 1, nx)), np.empty((stages, nu)), np.empty((stages, p.W.shape[1])))
