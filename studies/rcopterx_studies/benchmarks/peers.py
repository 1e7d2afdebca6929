"""PIQP in the place of our own solver, in its sparse form; it keeps its workspace, as documented."""

from collections.abc import Callable
from importlib import import_module
from typing import Any, ClassVar, Final

import numpy as np

from rcopterx.control.interfaces import never
from rcopterx.control.solver.active_set import rated
from rcopterx.control.solver.osqp import SparseQP
from rcopterx.control.solver.problem import OptimalControlProblem, Solution

TOLERANCE: Final = 1e-6  # looser ones leave inputs a hundredth of their range from the solution
EXACT: Final = 1e-9
PIQP: Final = "piqp"  # what must be installed


class PiqpSparse:
    """PIQP, a proximal interior-point method, as a `rcopterx.control.solver.problem.Solver`."""

    backend: ClassVar[str] = "sparse_ldlt"
    _qp: SparseQP | None = None

    def __init__(self, tolerance: float = TOLERANCE) -> None:
        self._tolerance = tolerance
        self._module: Any = import_module(PIQP)

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
        plan, solved = qp.plan_of(np.array(result.x), p), bool(status == self._module.PIQP_SOLVED)
        return rated(p, plan, np.zeros(plan.y.shape), int(result.info.iter), solved)


class PiqpMultistage(PiqpSparse):
    """PIQP with its backend for multistage problems."""

    backend = "sparse_multistage"
