"""The default solver: an active-set iteration on Riccati sweeps, with an interior point as fallback.

The active set of the last plan, shifted by a stage, is the first guess of the next one, so that most control
periods take one or two sweeps. Without active bounds the factor stays as long as the weighted part of the
problem does. Where the active set does not converge (a set point moved far), the interior point solves from
the beginning, and its active bounds are verified by sweeps.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from rcopterx.control.interfaces import never
from rcopterx.control.solver.active_set import (
    ActiveSet,
    best_plan,
    empty_plan,
    iterate_active_set,
    rated,
    rolled_out,
    update_active_set,
    within_hard_bounds,
)
from rcopterx.control.solver.interior_point import FEASIBLE, Barrier, active_rows, iterate, residuals
from rcopterx.control.solver.problem import OptimalControlProblem, Solution
from rcopterx.control.solver.sweep import Factor, curvature
from rcopterx.vehicles.state import Array

READABLE: Final = (1e-3, 1e-5, 1e-7, 1e-9)
"""Mean complementarities, over the curvature of the cost, to read the active set at; optimal at last."""


class RiccatiSolver:
    """Workspace that solves one problem after another, warm-started; the shapes of arrays may change."""

    def __init__(self, max_iterations: int = 40) -> None:
        self._max_iterations = max_iterations
        self._active = ActiveSet.empty(0, 0)
        self._inputs: Array | None = None
        self._factored = False
        self.reset()

    def reset(self) -> None:
        """Start the next solve cold."""
        self._shape: tuple[int, ...] = ()

    def solve(
        self, p: OptimalControlProblem, same_cost: bool = False, expired: Callable[[], bool] = never
    ) -> Solution:
        """Solve a problem, one stage after the last one (`rcopterx.control.solver.problem.Solver`)."""
        if self._shape != p.C.shape + p.D.shape:
            self._allocate(p)
        self._factored = self._factored and same_cost
        side = self._active.side
        side[:-1] = side[1:]
        plan = self._attempt(p, expired)
        if not plan.optimal and self._inputs is not None and not expired():
            # Nothing that the last problem left behind can keep this one from being solved.
            side[:] = 0.0
            plan = self._attempt(p, expired)
        if not plan.optimal:
            best = best_plan(p, plan.u, self._inputs)
            side[:] = 0.0
            update_active_set(p, best.y, side)
            plan = rated(p, best, side.copy(), plan.iterations, converged=False)
        self._inputs = plan.u
        return plan

    def _allocate(self, p: OptimalControlProblem) -> None:
        """Make room for problems of these shapes; nothing is known of them yet."""
        stages, rows, nx = p.C.shape
        nu = p.D.shape[2]
        self._shape = p.C.shape + p.D.shape
        self._free, self._bounded = (Factor.empty(stages, nx, nu) for _ in range(2))
        self._factored = False
        self._active = ActiveSet.empty(stages, rows)
        self._inputs = None

    def _attempt(self, p: OptimalControlProblem, expired: Callable[[], bool]) -> Solution:
        """Solve from the present active set."""
        plan = self._iterate_active_set(p)
        if plan.optimal or expired() or not np.isfinite(plan.u).all():
            return plan
        return self._interior_point(p, plan, expired)

    def _iterate_active_set(self, p: OptimalControlProblem) -> Solution:
        """Sweep until the active set stays."""
        plan, active = empty_plan(p), self._active
        sweeps, optimal, self._factored = iterate_active_set(
            p, active, self._free, self._bounded, self._factored, plan
        )
        return Solution(*plan, active.side.copy(), sweeps, optimal)

    def _interior_point(
        self, p: OptimalControlProblem, start: Solution, expired: Callable[[], bool]
    ) -> Solution:
        """Solve from a plan's inputs."""
        unit, inside = curvature(p), rolled_out(p, within_hard_bounds(p, start.u))
        barrier, trial = Barrier.at(p, inside.y, unit), empty_plan(p)
        iterations, converged, levels = start.iterations, False, list(READABLE)
        complementarity, gap = residuals(p, inside, barrier)
        for _ in range(self._max_iterations):
            if expired() or converged:
                break
            iterate(p, inside, trial, self._bounded, barrier, complementarity)
            iterations += 1
            complementarity, gap = residuals(p, inside, barrier)
            if complementarity < levels[0] * unit and gap < FEASIBLE:
                self._active.side[:] = active_rows(p, barrier, unit)
                verified = self._iterate_active_set(p)
                if verified.optimal:
                    return verified._replace(iterations=iterations)
                converged = len(levels) == 1
                del levels[0]
        return rated(p, inside, self._active.side.copy(), iterations, converged)
