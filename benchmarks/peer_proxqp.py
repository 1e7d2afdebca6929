"""ProxQP, a proximal augmented Lagrangian method, on the paper's problem as the controller poses it."""

from importlib import import_module
from typing import Any, Final

import numpy as np
from scipy import sparse

from rcopterx.control.controllers.paper.stage_qp import Outcome, StageQP, sparse_with_places
from rcopterx.vehicles.state import Array

TOLERANCE: Final = 1e-6
"""Looser ones leave inputs a tenth of their range from the solution at set-point steps."""


class ProxqpStageQP(StageQP):
    """Equalities and rows of bounds, started from the shifted plan."""

    def _install(
        self,
        hessian: sparse.csc_matrix,
        constraint: sparse.csc_matrix,
        time_limit_s: float,  # noqa: ARG002 - ProxQP has no clock
    ) -> None:
        self._proxqp: Any = import_module("proxsuite").proxqp
        self._equalities = self._structure.stages * self._nx
        self._constraint = constraint
        self._hessian_matrix = hessian
        self._bound_rows = constraint[self._equalities :].tocsc()
        self._peer: Any = self._proxqp.sparse.QP(self._size, self._equalities, self._bound_rows.shape[0])
        self._peer.settings.eps_abs = self._peer.settings.eps_rel = TOLERANCE
        self._peer.settings.initial_guess = self._proxqp.InitialGuess.WARM_START
        self._started = False
        self._changed = False
        self._primal = np.zeros(self._size)

    def _replace_dynamics(self, values: Array) -> None:
        self._constraint.data[self._dynamics_places] = values
        self._changed = True

    def _replace_terminal_cost(self, values: Array) -> None:
        self._hessian_matrix.data[self._terminal_places] = values
        self._changed = True

    def _start_from(self, primal: Array, duals: Array) -> None:  # noqa: ARG002 - the same as `_duals`
        self._primal = primal

    def _run(self) -> Outcome | None:
        split = self._equalities
        numbers: dict[str, Any] = {
            "g": self._gradient,
            "b": self._lower[:split],
            "l": self._lower[split:],
            "u": self._upper[split:],
        }
        if not self._started:
            self._peer.init(self._whole_hessian(), numbers["g"], self._equality_rows(), numbers["b"],
                            self._bound_rows, numbers["l"], numbers["u"])  # fmt: skip
            self._started = True
        else:
            if self._changed:
                numbers |= {"H": self._whole_hessian(), "A": self._equality_rows()}
            self._peer.update(**numbers)
        self._changed = False
        self._peer.solve(self._primal, self._duals[:split], self._duals[split:])
        results = self._peer.results
        solved = results.info.status == self._proxqp.QPSolverOutput.PROXQP_SOLVED
        duals = np.concatenate((results.y, results.z))
        return Outcome(results.x.copy(), duals, solved, int(results.info.iter))

    def _whole_hessian(self) -> sparse.csc_matrix:
        """Both triangles, with explicit zeros, which sums of sparse matrices lose: the pattern stays."""
        upper = self._hessian_matrix
        rows = upper.indices.astype(np.int64)
        columns = np.repeat(np.arange(self._size), np.diff(upper.indptr))
        below = rows != columns
        matrix, _ = sparse_with_places(
            np.concatenate((rows, columns[below])),
            np.concatenate((columns, rows[below])),
            np.concatenate((upper.data, upper.data[below])),
            upper.shape,
        )
        return matrix

    def _equality_rows(self) -> sparse.csc_matrix:
        return self._constraint[: self._equalities].tocsc()
