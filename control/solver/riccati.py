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
from rcopterx.control.solver.active_set import ActiveSet, iterate_active_set, update_active_set
from rcopterx.control.solver.candidates import best_plan, empty_plan, rated
from rcopterx.control.solver.interior_point import FEASIBLE, Barrier, active_rows, iterate, residuals
from rcopterx.control.solver.problem import OptimalControlProblem, Plan, Trajectories
from rcopterx.control.solver.sweep import Factor
from rcopterx.vehicles.state import Array

READABLE: Final = (1e-3, 1e-5, 1e-7)  # mean complementarities to read the active set at; optimal at last


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
    ) -> Plan:
        """Solve a problem, one stage after the last one (`rcopterx.control.solver.problem.Solver`)."""
        if self._shape != p.C.shape + p.D.shape:
            self._allocate(p)
        self._factored = self._factored and same_cost
        self._active.side[:-1] = self._active.side[1:]
        plan = empty_plan(p)
        iterations, optimal = self._iterate_active_set(p, plan)
        if not optimal and not expired():
            plan, further, optimal = self._interior_point(p, plan, expired)
            iterations += further
        if not optimal:
            plan = best_plan(p, plan.u, self._inputs)
            update_active_set(p, plan.y, self._active.side)
        self._inputs = plan.u
        return rated(p, plan, self._active.side.copy(), iterations, optimal)

    def _allocate(self, p: OptimalControlProblem) -> None:
        """Make room for problems of these shapes; nothing is known of them yet."""
        stages, rows, nx = p.C.shape
        nu = p.D.shape[2]
        self._shape = p.C.shape + p.D.shape
        self._free, self._bounded = (
            Factor(np.empty((stages, nu, nx)), np.empty((stages, nu, nu)), np.empty((stages + 1, nx, nx)))
            for _ in range(2)
        )
        self._factored = False
        self._active = ActiveSet.empty(stages, rows)
        self._inputs = None

    def _iterate_active_set(self, p: OptimalControlProblem, plan: Trajectories) -> tuple[int, bool]:
        """Sweep until the active set stays; return the number of sweeps, and whether it does."""
        sweeps, converged, self._factored = iterate_active_set(
            p, self._active, self._free, self._bounded, self._factored, plan
        )
        return sweeps, converged

    def _interior_point(
        self, p: OptimalControlProblem, inside: Trajectories, expired: Callable[[], bool]
    ) -> tuple[Trajectories, int, bool]:
        """Solve from a plan that satisfies the dynamics; return plan, iterations, and whether optimal."""
        barrier, trial = Barrier.at(p, inside.y), empty_plan(p)
        levels = iter(READABLE)
        level = next(levels)
        for iteration in range(self._max_iterations):
            complementarity, gap = residuals(p, inside, barrier)
            if complementarity < level and gap < FEASIBLE:
                verified = empty_plan(p)
                self._active.side[:] = active_rows(barrier)
                if self._iterate_active_set(p, verified)[1]:
                    return verified, iteration, True
                if complementarity < READABLE[-1]:
                    return inside, iteration, True
                level = next(levels)
            if expired():
                return inside, iteration, False
            iterate(p, inside, trial, self._bounded, barrier, complementarity)
        return inside, self._max_iterations, False
