"""Plans with their quality; and the plan that is flown when a solver stops before it converges."""

from typing import Final

import numpy as np

from rcopterx.control.solver.problem import OptimalControlProblem, Solution, Trajectories
from rcopterx.control.solver.sweep import quality, roll_out
from rcopterx.vehicles.state import Array

OPTIMAL: Final = 1e-3  # largest residuals of an optimal plan: of a stick, and of a change of an input


def rated(
    p: OptimalControlProblem, plan: Trajectories, active: Array, iterations: int, converged: bool
) -> Solution:
    """Return a rated plan; `converged`: by the solver's own tolerances; others as of `Solution`."""
    _, primal, dual = quality(p, plan)
    return Solution(*plan, active, iterations, primal, dual, converged and small(primal, dual))


def small(primal: float, dual: float) -> bool:
    """Whether residuals are those of an optimal plan; they are not where a number is not finite."""
    return primal < OPTIMAL and 0.0 <= dual < OPTIMAL


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
