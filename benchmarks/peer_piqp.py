"""PIQP in the place of the controllers' own solvers, on exactly the problems that they pose."""

from importlib import import_module
from typing import Any, ClassVar, Final

import numpy as np
from scipy import sparse

from rcopterx.control.controllers.chains.active_set import UNLIMITED, Budget, ChainSolution
from rcopterx.control.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.control.controllers.chains.chain_qp import ChainQP
from rcopterx.control.controllers.paper.stage_qp import Indices, Outcome, StageQP, sparse_with_places
from rcopterx.vehicles.state import Array

TOLERANCE: Final = 1e-6
"""Looser ones leave inputs a hundredth of their range from the solution at set-point steps."""


class PiqpStageQP(StageQP):
    """The whole problem by PIQP; rows of bounds become bounds of variables."""

    backend: ClassVar[str] = "sparse_ldlt"
    tolerance: ClassVar[float] = TOLERANCE

    def _install(
        self,
        hessian: sparse.csc_matrix,
        constraint: sparse.csc_matrix,
        time_limit_s: float,  # noqa: ARG002 - PIQP has no clock
    ) -> None:
        piqp: Any = import_module("piqp")

        self._equalities = self._structure.stages * self._nx
        bounds = constraint[self._equalities :].tocsr()
        self._bounded_columns = bounds.indices.copy()
        self._equality_places, self._equality_matrix = _top_rows(constraint, self._equalities)
        self._hessian_matrix = hessian
        self._constraint_values = constraint.data.copy()
        self._variable_bounds = np.full((2, self._size), np.inf)
        self._variable_bounds[0] *= -1.0
        self._peer = piqp.SparseSolver()
        _tune(self._peer, self.backend, self.tolerance)
        self._started = False

    def _replace_dynamics(self, values: Array) -> None:
        self._constraint_values[self._dynamics_places] = values
        self._equality_matrix.data[:] = self._constraint_values[self._equality_places]
        if self._started:
            self._peer.update(A=self._equality_matrix)

    def _replace_terminal_cost(self, values: Array) -> None:
        self._hessian_matrix.data[self._terminal_places] = values
        if self._started:
            self._peer.update(P=self._hessian_matrix)

    def _start_from(self, primal: Array, duals: Array) -> None:
        """Interior-point methods start from their own point."""

    def _run(self) -> Outcome | None:
        piqp: Any = import_module("piqp")

        lower, upper = self._variable_bounds
        lower[self._bounded_columns] = self._lower[self._equalities :]
        upper[self._bounded_columns] = self._upper[self._equalities :]
        right = self._lower[: self._equalities]
        if self._started:
            self._peer.update(c=self._gradient, b=right, x_l=lower, x_u=upper)
        else:
            self._peer.setup(
                self._hessian_matrix,
                self._gradient,
                self._equality_matrix,
                right,
                None,
                None,
                None,
                lower,
                upper,
            )
            self._started = True
        status = self._peer.solve()
        result = self._peer.result
        return Outcome(result.x, self._duals, status == piqp.PIQP_SOLVED, int(result.info.iter))


class PiqpMultistageQP(PiqpStageQP):
    """PIQP with its backend for multistage problems."""

    backend = "sparse_multistage"


class ExactStageQP(PiqpStageQP):
    """The judge."""

    tolerance = 1e-9


class PiqpChainQP(ChainQP):
    """A chain's problem in states, inputs and slacks of the soft bounds, by PIQP."""

    backend: ClassVar[str] = "sparse_multistage"
    tolerance: ClassVar[float] = TOLERANCE

    def __init__(self, parameters: ChainParameters, max_iterations: int) -> None:
        piqp: Any = import_module("piqp")

        super().__init__(parameters, max_iterations)
        p, m = parameters, parameters.axes
        self._parameters = p
        self._states = p.levels * m
        self._soft = np.flatnonzero([*p.position_bounded, *(m * [True])])
        self._block = self._states + m + len(self._soft)
        self._size = p.stages * self._block
        self._hessian, self._terminal_places = self._build_hessian()
        self._equality, self._turn_places, self._transition_places = self._build_equality()
        self._soft_matrix = self._build_soft()
        self._gradient = np.zeros(self._size)
        self._right = np.zeros(p.stages * self._states)
        self._peer = piqp.SparseSolver()
        _tune(self._peer, self.backend, self.tolerance)
        self._started = False

    def set_matrices(self, turn: Array, transition: Array, terminal_cost: Array) -> None:
        """Replace E, F and the terminal cost."""
        p = self._parameters
        steps = p.stages - 1
        self._turn, self._transition, self._cost = turn, transition, terminal_cost
        self._equality.data[self._turn_places] = (p.period_s * turn[:steps]).ravel()
        self._equality.data[self._transition_places] = transition[:steps].ravel()
        self._hessian.data[self._terminal_places] = terminal_cost[np.triu_indices(self._states)]
        if self._started:
            self._peer.update(P=self._hessian, A=self._equality)

    def solve(
        self,
        first_state: Array,
        disturbance: Array,
        target: ChainTarget,
        budget: Budget = UNLIMITED,  # noqa: ARG002 - it cannot be stopped
    ) -> ChainSolution:
        """Solve in the inputs with the disturbance's balance added, in which there is no disturbance."""
        piqp: Any = import_module("piqp")

        p, m = self._parameters, self._parameters.axes
        balance = self.chain.balance(disturbance)
        first = first_state.copy()
        first[2:] += balance
        self._right[: self._states] = first.ravel()
        parts = self._gradient.reshape(p.stages, self._block)
        parts[1:-1, :m] = -p.position_weights * target.rows[1:-1, :m]
        parts[1:-1, m : 2 * m] = -p.velocity_weights * target.rows[1:-1, m : 2 * m]
        parts[:-1, self._states : self._states + m] = -p.input_weights * target.rows[:-1, 2 * m :]
        parts[-1, : self._states] = -self._cost @ target.terminal
        lower, upper = np.full((2, p.stages, self._block), np.inf)
        lower *= -1.0
        lowest, highest = target.bounds_of_stages()
        for bounds, values in ((lower, lowest), (upper, highest)):
            bounds[:, self._states : self._states + m] = values[:, 2 * m :]
        soft_lower, soft_upper = (values[1:, self._soft].ravel() for values in (lowest, highest))
        vectors = {"c": self._gradient, "b": self._right, "h_l": soft_lower, "h_u": soft_upper}
        vectors |= {"x_l": lower.ravel(), "x_u": upper.ravel()}
        if self._started:
            self._peer.update(**vectors)
        else:
            self._peer.setup(P=self._hessian, A=self._equality, G=self._soft_matrix, **vectors)
            self._started = True
        solved = self._peer.solve() == piqp.PIQP_SOLVED
        found = self._peer.result.x.reshape(p.stages, self._block)
        inputs = found[:-1, self._states : self._states + m] - balance
        return ChainSolution(self._flat(found), inputs, solved, int(self._peer.result.info.iter))

    def _flat(self, found: Array) -> Array:
        """Positions of the stages and of those after them that the last state determines."""
        p, m = self._parameters, self._parameters.axes
        last, flat = p.stages - 1, [found[:, :m]]
        position, velocity = found[-1, :m], found[-1, m : 2 * m]
        for further in range(p.levels - 1):
            position = position + p.period_s * self._turn[last + further] @ velocity
            flat.append(position[None])
            if p.levels == 3:
                push = p.period_s * p.gain * found[-1, 2 * m : 3 * m]
                velocity = self._transition[last] @ velocity + push
        return np.concatenate(flat)

    def _build_hessian(self) -> tuple[sparse.csc_matrix, Indices]:
        p, m = self._parameters, self._parameters.axes
        diagonal = np.zeros((p.stages, self._block))
        diagonal[1:-1, :m], diagonal[1:-1, m : 2 * m] = p.position_weights, p.velocity_weights
        diagonal[:, self._states : self._states + m] = p.input_weights
        diagonal[:, self._states + m :] = p.soft_weight
        at = np.arange(self._size)
        keep = (at < self._size - self._block) | (at >= self._size - self._block + self._states)
        rows, columns = np.triu_indices(self._states)
        offset = self._size - self._block
        matrix, places = sparse_with_places(
            np.concatenate((at[keep], rows + offset)),
            np.concatenate((at[keep], columns + offset)),
            np.concatenate((diagonal.ravel()[keep], np.ones(len(rows)))),
            (self._size, self._size),
        )
        return matrix, places[keep.sum() :]

    def _build_equality(self) -> tuple[sparse.csc_matrix, Indices, Indices]:
        p, m, nx = self._parameters, self._parameters.axes, self._states
        steps = p.stages - 1
        stage = np.arange(steps)[:, None]
        square = np.indices((m, m)).reshape(2, -1)
        line = np.arange(m)
        identity = np.arange(nx)
        entries = [
            ((stage + 1) * nx + square[0], stage * self._block + m + square[1], np.ones(m * m)),
            ((stage + 1) * nx + m + square[0], stage * self._block + m + square[1], np.ones(m * m)),
            ((stage + 1) * nx + line, stage * self._block + line, np.ones(m)),
            ((stage + 1) * nx + identity, (stage + 1) * self._block + identity, -np.ones(nx)),
            ((stage + 1) * nx + m + line, stage * self._block + 2 * m + line, p.period_s * p.gain),
        ]
        if p.pole is not None:
            lag = (stage + 1) * nx + 2 * m + line
            entries.append((lag, stage * self._block + 2 * m + line, p.pole))
            entries.append((lag, stage * self._block + nx + line, 1.0 - p.pole))
        entries.append((identity[None], identity[None], np.ones(nx)))
        matrix, places = sparse_with_places(
            np.concatenate([rows.ravel() for rows, _, _ in entries]),
            np.concatenate([columns.ravel() for _, columns, _ in entries]),
            np.concatenate([np.broadcast_to(values, rows.shape).ravel() for rows, _, values in entries]),
            (p.stages * nx, self._size),
        )
        count = steps * m * m
        return matrix, places[:count], places[count : 2 * count]

    def _build_soft(self) -> sparse.csc_matrix:
        p, m = self._parameters, self._parameters.axes
        stage = np.arange(1, p.stages)[:, None]
        rows = np.arange((p.stages - 1) * len(self._soft))
        states = (stage * self._block + self._soft).ravel()
        slacks = (stage * self._block + self._states + m + np.arange(len(self._soft))).ravel()
        ones = np.ones(len(rows))
        return sparse.csc_matrix(
            (np.concatenate((ones, -ones)), (np.tile(rows, 2), np.concatenate((states, slacks)))),
            shape=(len(rows), self._size),
        )


class ExactChainQP(PiqpChainQP):
    """The judge."""

    tolerance = 1e-10


def _tune(solver: Any, backend: str, tolerance: float) -> None:
    piqp: Any = import_module("piqp")

    solver.settings.kkt_solver = getattr(piqp.KKTSolver, backend)
    solver.settings.eps_abs = solver.settings.eps_rel = tolerance
    solver.settings.eps_duality_gap_abs = solver.settings.eps_duality_gap_rel = tolerance
    solver.settings.verbose = False


def _top_rows(matrix: sparse.csc_matrix, rows: int) -> tuple[Indices, sparse.csc_matrix]:
    """First rows of a compressed matrix, and where their entries are in its data; explicit zeros are kept."""
    places = np.flatnonzero(matrix.indices < rows)
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))[places]
    starts = np.concatenate(([0], np.cumsum(np.bincount(columns, minlength=matrix.shape[1]))))
    top = sparse.csc_matrix(
        (matrix.data[places].copy(), matrix.indices[places], starts), shape=(rows, matrix.shape[1])
    )
    return places, top
