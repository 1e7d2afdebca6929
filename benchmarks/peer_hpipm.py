"""HPIPM, through CasADi, in the place of the paper scheme's solver, on exactly the problems that it poses."""

from importlib import import_module
from typing import Any, Final

import numpy as np
from scipy import sparse

from rcopterx.control.controllers.paper.stage_qp import Outcome, StageQP
from rcopterx.vehicles.state import Array

TOLERANCE: Final = 1e-6
STAND_IN_FOR_INFINITY: Final = 100.0
"""In scaled variables; the interface's own default makes the solver fail."""


class HpipmStageQP(StageQP):
    """The whole problem by HPIPM; the first state is fixed by bounds."""

    def _install(
        self,
        hessian: sparse.csc_matrix,
        constraint: sparse.csc_matrix,
        time_limit_s: float,  # noqa: ARG002 - HPIPM has no clock
    ) -> None:
        casadi: Any = import_module("casadi")

        nx, nu, stages = self._nx, self._nu, self._structure.stages
        self._equalities = stages * nx
        self._bounded_columns = constraint[self._equalities :].tocsr().indices.copy()
        dynamics = constraint[: self._equalities][nx:].tocsc()
        self._constraint_values = constraint.data.copy()
        positions = constraint.copy()
        positions.data = np.arange(1, constraint.nnz + 1, dtype=float)
        self._gap_places = positions[: self._equalities][nx:].tocsc().data.astype(np.int64) - 1
        self._gap_values = self._constraint_values[self._gap_places]
        # sums of sparse matrices lose explicit zeros, so the pattern is summed
        pattern = hessian.copy()
        pattern.data[:] = 1.0
        full = (pattern + sparse.triu(pattern, 1).T).tocsc()
        full.sort_indices()
        columns = np.repeat(np.arange(self._size), np.diff(full.indptr))
        self._hessian_values = hessian.diagonal()[columns]
        block = self._size - nx
        self._terminal_entries = np.flatnonzero(full.indices >= block)
        self._terminal_where = (
            full.indices[self._terminal_entries] - block,
            columns[self._terminal_entries] - block,
        )
        self._hessian_values[self._terminal_entries] = self._terminal_cost[self._terminal_where]
        options = {
            "N": stages - 1,
            "nx": [nx] * stages,
            "nu": [nu] * (stages - 1) + [0],
            "ng": [0] * stages,
            "inf": STAND_IN_FOR_INFINITY,
            "hpipm": dict.fromkeys(("res_g_max", "res_b_max", "res_d_max", "res_m_max"), TOLERANCE),
            "print_time": False,
            "error_on_fail": False,
        }
        peer = casadi.conic(
            "peer", "hpipm", {"h": _sparsity(casadi, full), "a": _sparsity(casadi, dynamics)}, options
        )
        self._bounds = np.full((2, self._size), np.inf)
        self._bounds[0] *= -1.0
        self._gap_bounds = np.zeros(dynamics.shape[0])
        self._result = np.zeros(self._size)
        self._peer = peer
        buffer, self._trigger = peer.buffer()
        arguments: dict[str, Any] = {
            "h": self._hessian_values,
            "g": self._gradient,
            "a": self._gap_values,
            "lba": self._gap_bounds,
            "uba": self._gap_bounds,
            "lbx": self._bounds[0],
            "ubx": self._bounds[1],
        }
        results: dict[str, Any] = {"x": self._result}
        # the interface reads every argument and writes every result, so none may be missing
        self._arguments = [
            memoryview(arguments.get(name, np.zeros(max(peer.nnz_in(index), 1))))
            for index, name in enumerate(peer.name_in())
        ]
        self._results = [
            memoryview(results.get(name, np.zeros(max(peer.nnz_out(index), 1))))
            for index, name in enumerate(peer.name_out())
        ]
        self._buffer = buffer

    def _replace_dynamics(self, values: Array) -> None:
        self._constraint_values[self._dynamics_places] = values
        self._gap_values[:] = self._constraint_values[self._gap_places]

    def _replace_terminal_cost(self, values: Array) -> None:  # noqa: ARG002 - the symmetric matrix is read
        self._hessian_values[self._terminal_entries] = self._terminal_cost[self._terminal_where]

    def _start_from(self, primal: Array, duals: Array) -> None:
        """Interior-point methods start from their own point."""

    def _run(self) -> Outcome | None:
        nx = self._nx
        lower, upper = self._bounds
        lower[self._bounded_columns] = self._lower[self._equalities :]
        upper[self._bounded_columns] = self._upper[self._equalities :]
        lower[:nx] = upper[:nx] = self._lower[:nx]
        self._gap_bounds[:] = self._lower[nx : self._equalities]
        # an evaluation moves the interface's pointers, so they are set every time
        for index, argument in enumerate(self._arguments):
            self._buffer.set_arg(index, argument)
        for index, result in enumerate(self._results):
            self._buffer.set_res(index, result)
        self._trigger()
        solved = bool(self._buffer.stats()["success"])
        return Outcome(self._result.copy(), self._duals, solved, 0)


def _sparsity(casadi: Any, matrix: sparse.csc_matrix) -> Any:
    return casadi.Sparsity(
        matrix.shape[0],
        matrix.shape[1],
        matrix.indptr.astype(int).tolist(),
        matrix.indices.astype(int).tolist(),
    )
