"""Other solvers of quadratic programs in the place of our own; each keeps its workspace, as documented."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from importlib import import_module
from typing import Any, ClassVar, Final

import numpy as np
from scipy import sparse

from rcopterx.control.interfaces import never
from rcopterx.control.solver.active_set import rated
from rcopterx.control.solver.osqp import SparseQP
from rcopterx.control.solver.problem import OptimalControlProblem, Solution
from rcopterx.vehicles.state import Array

TOLERANCE: Final = 1e-6  # looser ones leave inputs a hundredth of their range from the solution
EXACT: Final = 1e-9


class PeerSolver(ABC):
    """A `rcopterx.control.solver.problem.Solver` of another library."""

    package: ClassVar[str]  # what must be installed
    _qp: SparseQP | None = None

    def __init__(self, tolerance: float = TOLERANCE) -> None:
        self._tolerance = tolerance
        self._module: Any = import_module(self.package)

    def reset(self) -> None:
        """Start the next solve cold."""
        self._qp = None

    def solve(
        self,
        p: OptimalControlProblem,
        same_cost: bool = False,  # noqa: ARG002 - numbers are updated in any case
        expired: Callable[[], bool] = never,  # noqa: ARG002 - a benchmark waits for every solver
    ) -> Solution:
        """Solve a problem in its sparse form."""
        first = self._qp is None or not self._qp.fits(p)
        qp = SparseQP(p) if self._qp is None or first else self._qp
        self._qp = qp
        z, iterations, optimal = self._run(qp, p, first)
        plan = qp.plan_of(z, p)
        return rated(p, plan, np.zeros(plan.y.shape), iterations, optimal)

    @abstractmethod
    def _run(self, qp: SparseQP, p: OptimalControlProblem, first: bool) -> tuple[Array, int, bool]:
        """Return variables, iterations, and whether the tolerance is met."""


class PiqpSparse(PeerSolver):
    """PIQP, a proximal interior-point method."""

    package = "piqp"
    backend: ClassVar[str] = "sparse_ldlt"

    def _run(self, qp: SparseQP, p: OptimalControlProblem, first: bool) -> tuple[Array, int, bool]:
        constraints, (low, high), n = qp.constraints(p).tocsr(), qp.bounds(p), qp.equalities
        numbers = (qp.hessian(p), qp.gradient(p), constraints[:n].tocsc(), low[:n])
        bounds = (constraints[n:].tocsc(), low[n:], high[n:])
        if first:
            self._peer = self._module.SparseSolver()
            settings = self._peer.settings
            settings.kkt_solver = getattr(self._module.KKTSolver, self.backend)
            settings.eps_abs = settings.eps_rel = self._tolerance
            settings.check_duality_gap = False
            self._peer.setup(*numbers, *bounds)
        else:
            names = ("P", "c", "A", "b", "G", "h_l", "h_u")
            self._peer.update(**dict(zip(names, (*numbers, *bounds), strict=True)))
        status, result = self._peer.solve(), self._peer.result
        return np.array(result.x), int(result.info.iter), bool(status == self._module.PIQP_SOLVED)


class PiqpMultistage(PiqpSparse):
    """PIQP with its backend for multistage problems."""

    backend = "sparse_multistage"


class Clarabel(PeerSolver):
    """Clarabel, an interior-point method for cones."""

    package = "clarabel"

    def _run(self, qp: SparseQP, p: OptimalControlProblem, first: bool) -> tuple[Array, int, bool]:
        constraints, (low, high), n = qp.constraints(p).tocsr(), qp.bounds(p), qp.equalities
        matrix = sparse.vstack((constraints, -constraints[n:]), format="csc")
        right, hessian, gradient = np.concatenate((high, -low[n:])), qp.hessian(p), qp.gradient(p)
        if first:
            settings = self._module.DefaultSettings()
            settings.verbose = settings.presolve_enable = False
            settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = self._tolerance
            cones = [self._module.ZeroConeT(n), self._module.NonnegativeConeT(2 * (len(low) - n))]
            self._peer = self._module.DefaultSolver(hessian, gradient, matrix, right, cones, settings)
        else:
            self._peer.update(P=hessian, q=gradient, A=matrix, b=right)
        result = self._peer.solve()
        solved = result.status == self._module.SolverStatus.Solved
        return np.array(result.x), int(result.iterations), bool(solved)


class Proxqp(PeerSolver):
    """ProxQP, a proximal augmented Lagrangian method, warm-started by its last solution."""

    package = "proxsuite"

    def _run(self, qp: SparseQP, p: OptimalControlProblem, first: bool) -> tuple[Array, int, bool]:
        proxqp = self._module.proxqp
        constraints, (low, high), n = qp.constraints(p).tocsr(), qp.bounds(p), qp.equalities
        upper = qp.hessian(p)
        numbers = {
            "H": upper + sparse.triu(upper, 1).T,
            "g": qp.gradient(p),
            "A": constraints[:n].tocsc(),
            "b": low[:n],
            "C": constraints[n:].tocsc(),
            "l": low[n:],
            "u": high[n:],
        }
        if first:
            self._peer = proxqp.sparse.QP(qp.variables, n, len(low) - n)
            self._peer.settings.eps_abs = self._peer.settings.eps_rel = self._tolerance
            self._peer.settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
            self._peer.init(*numbers.values())
        else:
            self._peer.update(**numbers)
        self._peer.solve()
        results = self._peer.results
        solved = results.info.status == proxqp.QPSolverOutput.PROXQP_SOLVED
        return results.x.copy(), int(results.info.iter), bool(solved)
