"""One OSQP workspace for a multistage quadratic program, interleaved stage by stage.

    minimise    1/2 sum_i (x_i' Q x_i + u_i' R u_i) + 1/2 x_N' P x_N + q' z
    subject to  x_1 given,  x_{i+1} = A_i x_i + B u_i - c_i,  lower <= (bounded entries of x_i, u_i) <= upper

with z = (x_1, u_1, x_2, ..., u_{N-1}, x_N). Every entry that may ever be non-zero has a
place in the sparsity pattern, so sin(0) = 0 never changes it.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import osqp
from numpy.typing import NDArray
from osqp import OSQPException, SolverStatus
from scipy import sparse

from rcopterx.vehicles.state import Array

Indices = NDArray[np.int64]

EPS: Final = 1e-4
CHECK_TERMINATION: Final = 5
MAX_ITERATIONS: Final = 4000


@dataclass(frozen=True, slots=True)
class StageStructure:
    """Which entries of the problem exist.

    Attributes
    ----------
    stages
        N.
    dynamics_pattern
        Entries of A_i that may be non-zero, shape (nx, nx), bool.
    input_pattern
        Entries of B that may be non-zero, shape (nx, nu), bool.
    terminal_pattern
        Entries of P that may be non-zero, shape (nx, nx), bool, symmetric.
    bounded_states
        Indices of the states with bounds, from the second stage on (the first is the measurement).
    """

    stages: int
    dynamics_pattern: NDArray[np.bool_]
    input_pattern: NDArray[np.bool_]
    terminal_pattern: NDArray[np.bool_]
    bounded_states: Indices


@dataclass(frozen=True, slots=True)
class StageSolution:
    """What the solver returned.

    Attributes
    ----------
    states
        Shape (N, nx).
    inputs
        Shape (N - 1, nu).
    solved
        The tolerances were met; False if it stopped early.
    iterations
        ADMM iterations.
    """

    states: Array
    inputs: Array
    solved: bool
    iterations: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """Raw result of a solver: stacked variables and multipliers of all rows.

    Attributes
    ----------
    primal
        z, shape (size,).
    duals
        Shape (rows,).
    solved
        The tolerances were met.
    iterations
        Of the solver.
    """

    primal: Array
    duals: Array
    solved: bool
    iterations: int


class StageQP:
    """The workspace: set it up once, then update numbers and solve.

    Parameters
    ----------
    structure
        Sizes and patterns.
    dynamics, input_matrix, terminal_cost
        First A (nx, nx), B (nx, nu) and P (nx, nx).
    state_weights, input_weights
        Diagonals of Q and R.
    time_limit_s
        The solver stops after this time with its best iterate.
    """

    def __init__(
        self,
        structure: StageStructure,
        dynamics: Array,
        input_matrix: Array,
        terminal_cost: Array,
        state_weights: Array,
        input_weights: Array,
        time_limit_s: float,
    ) -> None:
        self._structure = structure
        self._nx, self._nu = input_matrix.shape
        self._stride = self._nx + self._nu
        self._size = structure.stages * self._stride - self._nu
        self._state_weights = state_weights
        self._input_weights = input_weights
        self._terminal_cost = terminal_cost
        constraint = self._constraint_matrix(dynamics, input_matrix)
        rows = constraint.shape[0]
        self._lower = np.zeros(rows)
        self._upper = np.zeros(rows)
        self._gradient = np.zeros(self._size)
        self._start = np.zeros(self._size)
        self._duals = np.zeros(rows)
        self._install(self._hessian(terminal_cost), constraint, time_limit_s)

    def set_dynamics(self, dynamics: Array) -> None:
        """Replace A, shape (nx, nx), at every stage."""
        values = np.tile(dynamics[self._structure.dynamics_pattern], self._structure.stages - 1)
        self._replace_dynamics(values)

    def set_terminal_cost(self, terminal_cost: Array) -> None:
        """Replace P, shape (nx, nx)."""
        self._terminal_cost = terminal_cost
        pattern = np.triu(self._structure.terminal_pattern)
        self._replace_terminal_cost(terminal_cost[pattern])

    def solve(
        self,
        first_state: Array,
        affine: Array,
        state_reference: Array,
        input_reference: Array,
        state_bounds: tuple[Array, Array],
        input_bounds: tuple[Array, Array],
    ) -> StageSolution | None:
        """Solve with new numbers, starting from the last `warm_start` or the last solution.

        Parameters
        ----------
        first_state
            x_1, shape (nx,).
        affine
            c, shape (nx,), subtracted at every stage.
        state_reference, input_reference
            Shapes (N, nx) and (N - 1, nu).
        state_bounds, input_bounds
            Lower and upper; shapes (N - 1, bounded states) for stages 2 to N, and (nu,).

        Returns
        -------
        StageSolution or None
            None if the solver has no finite iterate to offer.
        """
        stages, nx = self._structure.stages, self._nx
        gradient = self._gradient
        stage_part = gradient[: (stages - 1) * self._stride].reshape(stages - 1, self._stride)
        stage_part[:, :nx] = -self._state_weights * state_reference[:-1]
        stage_part[:, nx:] = -self._input_weights * input_reference
        gradient[-nx:] = -self._terminal_cost @ state_reference[-1]
        equalities = stages * nx
        inputs_end = equalities + (stages - 1) * self._nu
        for bound, state_bound, input_bound in zip(
            (self._lower, self._upper), state_bounds, input_bounds, strict=True
        ):
            bound[:nx] = first_state
            bound[nx:equalities].reshape(stages - 1, nx)[:] = affine
            bound[equalities:inputs_end].reshape(stages - 1, self._nu)[:] = input_bound
            bound[inputs_end:] = state_bound.ravel()
        outcome = self._run()
        return None if outcome is None else self._unpack(outcome)

    def cost(self, states: Array, inputs: Array, state_reference: Array, input_reference: Array) -> float:
        """Cost of a trajectory, up to the constant that does not depend on it; shapes as in `solve`."""
        error, effort = states - state_reference, inputs - input_reference
        stage = (self._state_weights * error[:-1] ** 2).sum() + (self._input_weights * effort**2).sum()
        return 0.5 * float(stage + error[-1] @ self._terminal_cost @ error[-1])

    def warm_start(self, states: Array, inputs: Array) -> None:
        """Start the next solve from a trajectory, shapes (N, nx) and (N - 1, nu), and shifted multipliers."""
        stages, nx = self._structure.stages, self._nx
        start = self._start
        stage_part = start[: (stages - 1) * self._stride].reshape(stages - 1, self._stride)
        stage_part[:, :nx] = states[:-1]
        stage_part[:, nx:] = inputs
        start[-nx:] = states[-1]
        self._start_from(start, self._duals)

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._duals[:] = 0.0
        self._start[:] = 0.0
        self._start_from(self._start, self._duals)

    def _install(
        self, hessian: sparse.csc_matrix, constraint: sparse.csc_matrix, time_limit_s: float
    ) -> None:
        """Hand the first matrices (upper triangle of the Hessian) to the solver."""
        self._solver = osqp.OSQP()
        self._solver.setup(
            hessian,
            self._gradient,
            constraint,
            self._lower,
            self._upper,
            verbose=False,
            eps_abs=EPS,
            eps_rel=EPS,
            check_termination=CHECK_TERMINATION,
            max_iter=MAX_ITERATIONS,
            time_limit=time_limit_s,
            polishing=False,
        )

    def _replace_dynamics(self, values: Array) -> None:
        """Replace the entries at `_dynamics_places` of the constraint matrix."""
        self._solver.update(Ax=values, Ax_idx=self._dynamics_places)

    def _replace_terminal_cost(self, values: Array) -> None:
        """Replace the entries at `_terminal_places` of the Hessian."""
        self._solver.update(Px=values, Px_idx=self._terminal_places)

    def _start_from(self, primal: Array, duals: Array) -> None:
        """Set the solver's starting point."""
        self._solver.warm_start(x=primal, y=duals)

    def _run(self) -> Outcome | None:
        """Solve with the present gradient and bounds; None if the solver refuses."""
        try:
            self._solver.update(q=self._gradient, l=self._lower, u=self._upper)
            result = self._solver.solve(raise_error=False)
        except OSQPException:
            return None
        solved = result.info.status_val == SolverStatus.OSQP_SOLVED
        return Outcome(result.x, result.y, bool(solved), int(result.info.iter))

    def _unpack(self, outcome: Outcome) -> StageSolution | None:
        primal, duals = outcome.primal, outcome.duals
        if not (np.isfinite(primal).all() and np.isfinite(duals).all()):
            self.forget()
            return None
        stages, nx = self._structure.stages, self._nx
        stage_part = primal[: (stages - 1) * self._stride].reshape(stages - 1, self._stride)
        states = np.vstack((stage_part[:, :nx], primal[-nx:]))
        self._shift_duals(duals)
        return StageSolution(states, stage_part[:, nx:].copy(), outcome.solved, outcome.iterations)

    def _shift_duals(self, duals: Array) -> None:
        """Multipliers of the next problem, one stage on."""
        stages, nx, nu = self._structure.stages, self._nx, self._nu
        edges = np.cumsum([nx, (stages - 1) * nx, (stages - 1) * nu])
        shifted = self._duals
        shifted[: edges[0]] = duals[: edges[0]]
        for begin, end, width in (
            (edges[0], edges[1], nx),
            (edges[1], edges[2], nu),
            (edges[2], len(duals), len(self._structure.bounded_states)),
        ):
            shifted[begin : end - width] = duals[begin + width : end]
            shifted[end - width : end] = duals[end - width : end]

    def _hessian(self, terminal_cost: Array) -> sparse.csc_matrix:
        pattern = np.triu(self._structure.terminal_pattern)
        diagonal = np.tile(
            np.concatenate((self._state_weights, self._input_weights)), self._structure.stages - 1
        )
        diagonal_at = np.arange(len(diagonal))
        rows, columns = np.nonzero(pattern)
        offset = len(diagonal)
        matrix, places = sparse_with_places(
            np.concatenate((diagonal_at, rows + offset)),
            np.concatenate((diagonal_at, columns + offset)),
            np.concatenate((diagonal, terminal_cost[pattern])),
            (self._size, self._size),
        )
        self._terminal_places = places[len(diagonal) :]
        return matrix

    def _constraint_matrix(self, dynamics: Array, input_matrix: Array) -> sparse.csc_matrix:
        structure, nx, nu = self._structure, self._nx, self._nu
        steps = structure.stages - 1
        state_at = np.arange(structure.stages) * self._stride
        equalities = structure.stages * nx
        blocks: list[tuple[Indices, Indices, Array]] = []

        def add(rows: Indices, columns: Indices, values: Array) -> None:
            blocks.append((rows.ravel(), columns.ravel(), values.ravel()))

        def stagewise(pattern: NDArray[np.bool_], values: Array, column_shift: int) -> None:
            rows, columns = np.nonzero(pattern)
            stage = np.arange(steps)[:, None]
            add(
                (stage + 1) * nx + rows,
                stage * self._stride + column_shift + columns,
                np.tile(values, (steps, 1)),
            )

        stagewise(structure.dynamics_pattern, dynamics[structure.dynamics_pattern], 0)
        stagewise(structure.input_pattern, input_matrix[structure.input_pattern], nx)
        first = np.arange(nx)
        add(first, first, np.ones(nx))
        next_rows = (np.arange(1, structure.stages)[:, None] * nx + first).astype(np.int64)
        add(next_rows, state_at[1:, None] + first, -np.ones(next_rows.shape))
        input_columns = state_at[:-1, None] + nx + np.arange(nu)
        add(np.arange(equalities, equalities + steps * nu), input_columns, np.ones(steps * nu))
        state_columns = state_at[1:, None] + structure.bounded_states
        bounded_from = equalities + steps * nu
        add(
            np.arange(bounded_from, bounded_from + state_columns.size),
            state_columns,
            np.ones(state_columns.size),
        )
        matrix, places = sparse_with_places(
            np.concatenate([block[0] for block in blocks]),
            np.concatenate([block[1] for block in blocks]),
            np.concatenate([block[2] for block in blocks]),
            (bounded_from + state_columns.size, self._size),
        )
        self._dynamics_places = places[: steps * int(structure.dynamics_pattern.sum())]
        return matrix


def sparse_with_places(
    rows: Indices, columns: Indices, values: Array, shape: tuple[int, int]
) -> tuple[sparse.csc_matrix, Indices]:
    """Compressed matrix and where each given entry ended up in its data; explicit zeros are kept."""
    order = np.lexsort((rows, columns))
    places = np.empty(len(order), dtype=np.int64)
    places[order] = np.arange(len(order))
    starts = np.concatenate(([0], np.cumsum(np.bincount(columns, minlength=shape[1]))))
    matrix = sparse.csc_matrix((values[order].astype(float), rows[order], starts), shape=shape)
    return matrix, places
