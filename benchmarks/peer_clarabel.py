"""Clarabel, an interior-point method for cones, on the paper's problem as the controller poses it."""

from importlib import import_module
from typing import Any, Final

import numpy as np
from scipy import sparse

from rcopterx.control.controllers.paper.stage_qp import Outcome, StageQP, sparse_with_places
from rcopterx.vehicles.state import Array

TOLERANCE: Final = 1e-6
"""As of the other interior-point methods."""


class ClarabelStageQP(StageQP):
    """Equalities in the zero cone; each bound a row of the non-negative cone."""

    def _install(
        self,
        hessian: sparse.csc_matrix,
        constraint: sparse.csc_matrix,
        time_limit_s: float,  # noqa: ARG002 - a benchmark waits for every solver
    ) -> None:
        self._clarabel: Any = import_module("clarabel")
        equalities = self._structure.stages * self._nx
        rows = constraint.indices.astype(np.int64)
        columns = np.repeat(np.arange(self._size), np.diff(constraint.indptr))
        bounds = rows >= equalities
        count = constraint.shape[0] - equalities
        self._matrix, self._places = sparse_with_places(
            np.concatenate((rows, rows[bounds] + count)),
            np.concatenate((columns, columns[bounds])),
            np.concatenate((constraint.data, -constraint.data[bounds])),
            (equalities + 2 * count, self._size),
        )
        self._equalities = equalities
        self._hessian_matrix = hessian
        self._cones = [self._clarabel.ZeroConeT(equalities), self._clarabel.NonnegativeConeT(2 * count)]
        self._settings = self._clarabel.DefaultSettings()
        self._settings.verbose = False
        self._settings.presolve_enable = False
        self._settings.tol_gap_abs = self._settings.tol_gap_rel = self._settings.tol_feas = TOLERANCE
        self._peer: Any = None

    def _replace_dynamics(self, values: Array) -> None:
        self._matrix.data[self._places[self._dynamics_places]] = values
        if self._peer is not None:
            self._peer.update(A=self._matrix)

    def _replace_terminal_cost(self, values: Array) -> None:
        self._hessian_matrix.data[self._terminal_places] = values
        if self._peer is not None:
            self._peer.update(P=self._hessian_matrix)

    def _start_from(self, primal: Array, duals: Array) -> None:
        """Interior-point methods start from their own point."""

    def _run(self) -> Outcome | None:
        right = np.concatenate((self._upper, -self._lower[self._equalities :]))
        if self._peer is None:
            self._peer = self._clarabel.DefaultSolver(
                self._hessian_matrix, self._gradient, self._matrix, right, self._cones, self._settings
            )
        else:
            self._peer.update(q=self._gradient, b=right)
        result = self._peer.solve()
        solved = result.status == self._clarabel.SolverStatus.Solved
        return Outcome(np.array(result.x), self._duals, solved, int(result.iterations))
