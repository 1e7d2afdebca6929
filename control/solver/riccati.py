"""The default solver: an active-set iteration on Riccati sweeps, with an interior point as fallback.

The active set of the last plan, shifted by a stage, is the first guess of the next one, so that most control
periods take one or two sweeps. Without active bounds the factor stays as long as the weighted part of the
problem does. Where the active set does not converge (a set point moved far), the interior point solves from
the beginning, and its active bounds are verified by sweeps.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from rcopterx.control.solver import interior_point
from rcopterx.control.solver.active_set import set_pulls, update_active_set
from rcopterx.control.solver.candidates import best_plan, empty_plan, shift
from rcopterx.control.solver.problem import OptimalControlProblem, Plan, never
from rcopterx.control.solver.sweep import Factor, factorize, quality, solve
from rcopterx.vehicles.state import Array

ACTIVE_SET_SWEEPS: Final = 8
"""Sweeps after which an active-set iteration that has not converged is given up."""
READABLE: Final = (1e-3, 1e-5, 1e-7)
"""Mean complementarities at which the active set is read from the interior point; the last one is optimal."""


class RiccatiSolver:
    """Workspace that solves one problem after another, warm-started; the shapes of arrays may change.

    Parameters
    ----------
    max_iterations
        Interior-point iterations after which the best plan known is returned.
    """

    def __init__(self, max_iterations: int = 40) -> None:
        self._max_iterations = max_iterations
        self._shape: tuple[int, ...] = ()
        self._factored = False
        self._active: Array = np.zeros((0, 0))
        self._inputs: Array | None = None

    def reset(self) -> None:
        """Start the next solve cold."""
        self._shape = ()

    def solve(
        self, p: OptimalControlProblem, same_cost: bool = False, expired: Callable[[], bool] = never
    ) -> Plan:
        """Solve a problem, one stage after the last one.

        Parameters
        ----------
        p
            The problem.
        same_cost
            Whether A, B, P and the rows with weights are those of the last solve.
        expired
            Deadline, checked before every factorization.
        """
        if self._shape != p.C.shape + p.D.shape:
            self._allocate(p)
        self._factored = self._factored and same_cost
        self._plan = empty_plan(p)
        shifted = self._inputs
        self._active = shift(self._active)
        sweeps, optimal = self._iterate_active_set(p, expired)
        if not optimal and not expired():
            further, optimal = self._interior_point(p, expired)
            sweeps += further
        if not optimal:
            self._plan = best_plan(p, self._plan.u, shifted)
            update_active_set(p, self._plan.y, self._active)
        _, primal, dual = quality(p, self._plan)
        self._inputs = shift(self._plan.u)
        return Plan(*self._plan, self._active.copy(), sweeps, primal, dual, optimal)

    def _allocate(self, p: OptimalControlProblem) -> None:
        """Make room for problems of these shapes; nothing is known of them yet."""
        stages, rows, nx = p.C.shape
        nu = p.D.shape[2]
        self._shape = p.C.shape + p.D.shape
        self._free, self._pulled = (
            Factor(np.empty((stages, nu, nx)), np.empty((stages, nu, nu)), np.empty((stages + 1, nx, nx)))
            for _ in range(2)
        )
        self._factored = False
        self._active = np.zeros((stages, rows))
        self._e, self._target = np.zeros((stages, rows)), np.zeros((stages, rows))
        self._inputs = None

    def _iterate_active_set(self, p: OptimalControlProblem, expired: Callable[[], bool]) -> tuple[int, bool]:
        """Sweep until the active set stays; return the number of sweeps, and whether it does."""
        for sweep in range(1, ACTIVE_SET_SWEEPS + 1):
            set_pulls(p, self._active, self._e, self._target)
            free = not self._active.any()
            factor = self._free if free else self._pulled
            if not (free and self._factored):
                if sweep > 1 and expired():
                    return sweep - 1, False
                factorize(p, self._e, factor)
                self._factored = self._factored or free
            solve(p, self._e, self._target, factor, self._plan)
            if update_active_set(p, self._plan.y, self._active) == 0:
                return sweep, True
        return ACTIVE_SET_SWEEPS, False

    def _interior_point(self, p: OptimalControlProblem, expired: Callable[[], bool]) -> tuple[int, bool]:
        """Solve from the unconstrained plan; return the number of iterations, and whether it converged."""
        barrier = interior_point.Barrier.zeros(*self._active.shape)
        inside, trial = self._plan, empty_plan(p)
        self._active[:] = 0.0
        interior_point.start(p, inside, barrier)
        levels = iter(READABLE)
        level = next(levels)
        for iteration in range(self._max_iterations):
            complementarity, gap = interior_point.residuals(p, inside, barrier)
            if complementarity < level and gap < interior_point.FEASIBLE:
                self._plan, self._active = empty_plan(p), interior_point.active_rows(barrier)
                if self._iterate_active_set(p, expired)[1]:
                    return iteration, True
                self._plan = inside
                if complementarity < READABLE[-1]:
                    return iteration, True
                level = next(levels)
            if expired():
                return iteration, False
            interior_point.iterate(p, inside, trial, self._pulled, barrier, complementarity)
        return self._max_iterations, False
