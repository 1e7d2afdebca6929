"""OSQP on the same problems (https://osqp.org), written as sparse quadratic programs.

Variables are, stage by stage, the state, the input and the excess over every soft bound:

    minimise    1/2 z' H z + g' z
    subject to  x_0 given,  x_{k+1} - A_k x_k - B_k u_k = c_k,  low <= C_k x_k + D_k u_k - excess_k <= high

The sparsity pattern stays as long as the shapes and the bounded rows do; then only numbers are updated.
"""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import osqp
from numpy.typing import NDArray
from scipy import sparse

from rcopterx.control.interfaces import never
from rcopterx.control.solver.active_set import best_plan, rated, update_active_set
from rcopterx.control.solver.problem import OptimalControlProblem, Solution, Trajectories
from rcopterx.vehicles.state import Array

FREE: Final = 1e20  # stands for an infinite bound
Indices = NDArray[np.int64]


class SparseQP:
    """The sparse form of problems of one shape; zeros keep their places in the matrices."""

    def __init__(self, p: OptimalControlProblem) -> None:
        N, nx, nu = p.B.shape
        self._shapes = p.C.shape, p.D.shape
        self._bounded = p.s > 0.0
        self._soft = self._bounded & np.isfinite(p.s)
        self._stage = nx + nu
        # number of rows of the constraints that are equalities; they come first
        self.equalities = (N + 1) * nx
        excesses = self._soft.sum(axis=1)
        self._starts: Indices = np.concatenate(([0], np.cumsum(self._stage + excesses)))
        self.variables = int(self._starts[-1]) + nx  # number of variables z
        stage = np.nonzero(self._soft)[0]
        before = np.concatenate(([0], np.cumsum(excesses)))[stage]
        self._excess: Indices = self._starts[stage] + self._stage + np.arange(len(stage)) - before
        self._hessian = self._hessian_places(N, nx)
        self._constraints = self._constraint_places(N, nx)

    def _hessian_places(self, N: int, nx: int) -> "Places":
        """Upper triangles of the stages and of the last state; excesses on the diagonal."""
        self._upper = np.triu_indices(self._stage), np.triu_indices(nx)
        (row, column), (last_row, last_column) = self._upper
        starts, last = self._starts[:N, None], self._starts[N]
        return Places(
            np.concatenate(((starts + row).ravel(), last + last_row, self._excess)),
            np.concatenate(((starts + column).ravel(), last + last_column, self._excess)),
            (self.variables, self.variables),
        )

    def _constraint_places(self, N: int, nx: int) -> "Places":
        """Rows: first state, dynamics, bounds."""
        states, within = np.arange(nx), np.arange(self._stage)
        dynamics = nx + np.arange(N * nx).reshape(N, nx)
        stage, row = np.nonzero(self._bounded)
        bounds = self.equalities + np.arange(len(stage))
        rows = (
            states,
            np.repeat(dynamics.ravel(), self._stage),
            dynamics.ravel(),
            np.repeat(bounds, self._stage),
            bounds[self._soft[stage, row]],
        )
        columns = (
            states,
            np.repeat(self._starts[:N, None] + within, nx, axis=0).ravel(),
            (self._starts[1:, None] + states).ravel(),
            (self._starts[stage, None] + within).ravel(),
            self._excess,
        )
        return Places(
            np.concatenate(rows), np.concatenate(columns), (self.equalities + len(stage), self.variables)
        )

    def fits(self, p: OptimalControlProblem) -> bool:
        """Whether a problem has the same shape and the same bounded rows."""
        return self._shapes == (p.C.shape, p.D.shape) and bool(((p.s > 0.0) == self._bounded).all())

    def hessian(self, p: OptimalControlProblem) -> sparse.csc_matrix:
        """Return the upper triangle of H."""
        CD = np.concatenate((p.C, p.D), axis=2)
        stages = np.einsum("kri,kr,krj->kij", CD, p.W, CD)
        stage, last = self._upper
        return self._hessian.filled(stages[:, *stage].ravel(), p.P[last], p.s[self._soft])

    def gradient(self, p: OptimalControlProblem) -> Array:
        """Return g."""
        N, nx, _ = p.B.shape
        g = np.zeros(self.variables)
        stages = -np.einsum("kri,kr->ki", np.concatenate((p.C, p.D), axis=2), p.W * p.r)
        g[self._starts[:N, None] + np.arange(self._stage)] = stages
        g[-nx:] = -p.P @ p.x_end
        return g

    def constraints(self, p: OptimalControlProblem) -> sparse.csc_matrix:
        """Return the left-hand sides: first state, dynamics, bounded rows."""
        N, nx, _ = p.B.shape
        dynamics = -np.concatenate((p.A, p.B), axis=2)
        rows = np.concatenate((p.C, p.D), axis=2)[self._bounded]
        return self._constraints.filled(
            np.ones(nx), dynamics.ravel(), np.ones(N * nx), rows.ravel(), -np.ones(len(self._excess))
        )

    def bounds(self, p: OptimalControlProblem) -> tuple[Array, Array]:
        """Return the right-hand sides, lower and upper."""
        equal = np.concatenate((p.x_0, p.c.ravel()))
        low, high = (np.clip(values[self._bounded], -FREE, FREE) for values in (p.low, p.high))
        return np.concatenate((equal, low)), np.concatenate((equal, high))

    def plan_of(self, z: Array, p: OptimalControlProblem) -> Trajectories:
        """Return the trajectories of a solution."""
        N, nx, _ = p.B.shape
        x = z[self._starts[:, None] + np.arange(nx)]
        u = z[self._starts[:N, None] + np.arange(nx, self._stage)]
        y = np.einsum("kri,ki->kr", p.C, x[:-1]) + np.einsum("kri,ki->kr", p.D, u)
        return Trajectories(x, u, y)


class Places:
    """A sparse matrix whose entries are given again and again in one order."""

    def __init__(self, rows: Indices, columns: Indices, shape: tuple[int, int]) -> None:
        numbered = sparse.csc_matrix((np.arange(1.0, len(rows) + 1.0), (rows, columns)), shape)
        self._order = numbered.data.astype(int) - 1
        self._matrix = numbered

    def filled(self, *values: Array) -> sparse.csc_matrix:
        """Return the matrix with these entries, in the order of rows and columns."""
        made = self._matrix.copy()
        made.data = np.concatenate(values)[self._order]
        return made


TOLERANCE: Final = 1e-4
MAX_ITERATIONS: Final = 4000


class OsqpSolver:
    """Workspace of OSQP, set up for each new shape, else warm-started.

    `time_limit_s` is its own, as it cannot be stopped from outside.
    """

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
