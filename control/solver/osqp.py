"""OSQP on the same problems (https://osqp.org), warm-started; only numbers are updated between solves."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import osqp

from rcopterx.control.interfaces import never
from rcopterx.control.solver.active_set import update_active_set
from rcopterx.control.solver.fallback import best_plan, rated
from rcopterx.control.solver.problem import OptimalControlProblem, Solution
from rcopterx.control.solver.sparse_qp import SparseQP
from rcopterx.vehicles.state import Array

TOLERANCE: Final = 1e-4
MAX_ITERATIONS: Final = 4000


class OsqpSolver:
    """Workspace of OSQP, set up for each new shape; `time_limit_s` as it cannot be stopped from outside."""

    def __init__(self, tolerance: float = TOLERANCE, time_limit_s: float = 0.012) -> None:
        self._tolerance, self._time_limit_s = tolerance, time_limit_s
        self._qp: SparseQP | None = None
        self._solver: Any = None
        self._inputs: Array | None = None

    def reset(self) -> None:
        """Start the next solve cold."""
        self._qp = None

    def solve(
        self,
        p: OptimalControlProblem,
        same_cost: bool = False,  # noqa: ARG002 - numbers are updated in any case
        expired: Callable[[], bool] = never,  # noqa: ARG002 - the time limit is OSQP's own
    ) -> Solution:
        """Solve a problem (`rcopterx.control.solver.problem.Solver`)."""
        if self._qp is None or not self._qp.fits(p):
            qp = self._qp = SparseQP(p)
            self._inputs = None
            self._solver = osqp.OSQP()
            self._solver.setup(
                qp.hessian(p),
                qp.gradient(p),
                qp.constraints(p),
                *qp.bounds(p),
                eps_abs=self._tolerance,
                eps_rel=self._tolerance,
                max_iter=MAX_ITERATIONS,
                time_limit=self._time_limit_s,
                check_termination=5,
                verbose=False,
            )
        else:
            qp = self._qp
            low, high = qp.bounds(p)
            H, G = qp.hessian(p), qp.constraints(p)
            self._solver.update(q=qp.gradient(p), l=low, u=high, Px=H.data, Ax=G.data)
        result = self._solver.solve()
        optimal = bool(result.info.status_val == osqp.SolverStatus.OSQP_SOLVED)
        plan = qp.plan_of(result.x, p)
        if not optimal:
            plan = best_plan(p, plan.u, self._inputs)
        active = np.zeros(plan.y.shape)
        update_active_set(p, plan.y, active)
        self._inputs = plan.u
        return rated(p, plan, active, int(result.info.iter), optimal)
