"""A chain of integrators with a lagged input, written in its flat output.

    position_{i+1} = position_i + T_s E_i velocity_i
    velocity_{i+1} = F_i velocity_i + T_s (b actuator_i + disturbance)
    actuator_{i+1} = pole actuator_i + (1 - pole) (input_i - feedback velocity_i)
                                                                 (without lag: actuator_i = input_i)

with E_i orthogonal and one or two axes: yaw, the vertical and, along a known heading plan, the horizontal
motion are all of this form (docs/formulas.md). Positions determine everything else: velocities are their
differences, actuators differences of those, inputs differences of those. In the positions y_i alone there are
no dynamics left to respect, every quantity of stage i is a row times the window (y_i, .., y_{i + levels}),
and the Hessian is a band: one Newton step is one banded Cholesky factorisation, linear in N.
Rows that keep the vehicle clear of others are of the same kind: a direction times the stage's position.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from rcopterx.native.chain import (
    chain_factor,
    chain_roll_out,
    chain_start,
    chain_step,
    chain_values,
    rows_of_positions,
)
from rcopterx.native.settling import chain_attempt
from rcopterx.vehicles.state import Array

INPUT_PENALTY: Final = 1e6
"""Penalty parameter of the augmented Lagrangian, against input weights of about one."""
INPUT_TOLERANCE: Final = 1e-5
"""Largest distance to an active input bound that counts as solved; what is left is cut off."""


@dataclass(frozen=True, slots=True)
class ChainParameters:
    """What does not change in flight; m is the number of axes.

    Attributes
    ----------
    stages
        N.
    period_s
        T_s.
    gain
        b, shape (m,).
    pole
        Discrete actuator pole, shape (m,); None for no lag.
    rate_feedback
        What is subtracted from the inputs per velocity, ahead of the lag, shape (m,); zero for no lag.
    position_weights, velocity_weights, input_weights
        Diagonals of the stage cost, shape (m,).
    soft_weight
        Weight of the squared excess over a state bound.
    position_bounded
        False for an axis whose position has no bounds (yaw), m entries.
    clearances
        Rows per stage for `Chain.set_clearances`, K.
    clearance_weight
        Weight of the squared excess over their bounds.
    """

    stages: int
    period_s: float
    gain: Array
    pole: Array | None
    rate_feedback: Array
    position_weights: Array
    velocity_weights: Array
    input_weights: Array
    soft_weight: float
    position_bounded: tuple[bool, ...]
    clearances: int = 0
    clearance_weight: float = 1.0

    @property
    def axes(self) -> int:
        """Number of axes m."""
        return len(self.gain)

    @property
    def levels(self) -> int:
        """States per axis."""
        return 2 if self.pole is None else 3

    @property
    def dynamics(self) -> tuple[Array, Array, Array, bool]:
        """Velocity per actuator and stage, pole, rate feedback, and whether there is a lag.

        As kernels take them; without a lag the pole means nothing.
        """
        pole = self.gain if self.pole is None else self.pole
        return self.period_s * self.gain, pole, self.rate_feedback, self.pole is not None


@dataclass(slots=True)
class ActiveBounds:
    """Guess of what binds.

    Attributes
    ----------
    side
        Bound each row presses on, shape (N, 3 m + K): -1 lower, 1 upper, 0 none.
    multipliers
        Of the input bounds, shape (N, m).
    values
        Rows at the point at which these bounds were found, shape (N, 3 m + K).
    """

    side: Array
    multipliers: Array
    values: Array

    @classmethod
    def none(cls, rows: tuple[int, ...], axes: int) -> "ActiveBounds":
        """No bound binds, where rows have this shape."""
        return cls(np.zeros(rows), np.zeros((rows[0], axes)), np.zeros(rows))

    def clear(self) -> None:
        """No bound binds."""
        self.side[:] = 0.0
        self.multipliers[:] = 0.0


@dataclass(slots=True)
class Factor:
    """A known factor of the Hessian.

    Attributes
    ----------
    numbers
        The factor, as `Chain.factorize` makes it.
    side
        Bounds that are active in it, shape (N, 3 m + K); no rows where there never are any.
    stale
        Whether it is of other matrices than the present ones.
    """

    numbers: Array
    side: Array
    stale: bool = True


class ChainTarget(NamedTuple):
    """Reference and bounds of the rows; inputs and actuators with the disturbance's `ChainQP.balance` added.

    Attributes
    ----------
    rows
        Shape (N, 3 m + K): position, velocity, input of each stage, the last stage without input; clearances
        have no reference.
    terminal
        Shape (levels m,): position, velocity[, actuator] of stage N.
    lower, upper
        Shape (1, 3 m + K), or (N, 3 m + K) where they differ from stage to stage.
    """

    rows: Array
    terminal: Array
    lower: Array
    upper: Array

    @classmethod
    def empty(cls, stages: int, rows: int, states: int) -> "ChainTarget":
        """One to be filled, with the same bounds at all stages."""
        lower, upper = np.empty((2, 1, rows))
        return cls(np.empty((stages, rows)), np.empty(states), lower, upper)

    def bounds_of_stages(self) -> tuple[Array, Array]:
        """Copies of the bounds for each stage, shape (N, 3 m + K), to be changed."""
        shape = len(self.rows), self.lower.shape[1]
        return np.broadcast_to(self.lower, shape).copy(), np.broadcast_to(self.upper, shape).copy()


def weigh_bounds(penalty: Array, bounded: Array, soft_weights: Array, inputs: slice) -> None:
    """Set the penalties of excesses over bounds: hard ones of the inputs, soft ones of the other rows.

    Parameters
    ----------
    penalty, bounded
        What is set, and 1 where a row is bounded, 0 elsewhere; shape (N, rows).
    soft_weights
        Of soft bounds, by row.
    inputs
        Rows of the inputs.
    """
    penalty[:] = bounded * soft_weights
    penalty[:, inputs] = bounded[:, inputs] * INPUT_PENALTY


class Chain:
    """Rows, cost and banded Hessian of one chain.

    Parameters
    ----------
    parameters
        Sizes, dynamics and weights.

    Attributes
    ----------
    weights
        Cost of each row, shape (N, 3 m + K).
    bounded
        1 where a row has bounds that bind, 0 else, shape (N, 3 m + K).
    soft_weights
        Weight of the squared excess over a bound; meaningless for inputs, whose bounds are hard. Shape
        (3 m + K,).
    inputs
        Columns of the inputs among the rows.
    flat
        The positions y, shape (N + levels, m); the last is padding.
    penalty
        Weight of the squared distance to an active bound, shape (N, 3 m + K).
    active
        The bounds that are active.
    attempt, problem
        The kernel that attempts to solve the problem, and its first arguments.
    plan_shapes
        Of planned positions and inputs, (N + levels - 1, m) and (N - 1, m).
    """

    attempt = staticmethod(chain_attempt)

    def __init__(self, parameters: ChainParameters) -> None:
        self.parameters = parameters
        stages, m, levels = parameters.stages, parameters.axes, parameters.levels
        self.inputs = slice(2 * m, 3 * m)
        self._clearances = slice(3 * m, 3 * m + parameters.clearances)
        rows = self._clearances.stop
        self._dynamics = parameters.dynamics
        self._push = self._dynamics[0]
        width = (levels + 1) * m
        self._rows: Array = np.zeros((stages, rows, width))
        self._rows[:, :m, :m] = np.eye(m)
        self._terminal_map: Array = np.eye(levels * m)
        self.weights: Array = np.zeros((stages, rows))
        self.weights[1:-1, :m] = parameters.position_weights
        self.weights[1:-1, m : 2 * m] = parameters.velocity_weights
        self.weights[:-1, self.inputs] = parameters.input_weights
        # the measured first state and the input after the horizon cannot be chosen, so no bound binds them
        self.bounded: Array = np.ones((stages, rows))
        self.bounded[0, : 2 * m] = 0.0
        self.bounded[-1, self.inputs] = 0.0
        self.bounded[:, :m] *= parameters.position_bounded
        self.bounded[:, self._clearances] = 0.0
        self.soft_weights: Array = np.full(rows, parameters.soft_weight)
        self.soft_weights[self._clearances] = parameters.clearance_weight
        self._free = slice(levels * m, (stages + levels - 1) * m)
        self.flat: Array = np.zeros((stages + levels, m))
        self._flat = self.flat.reshape(-1)
        self._change: Array = np.zeros((stages + levels) * m)
        self._terminal_cost: Array = np.zeros((levels * m, levels * m))
        self._terminal_hessian: Array = np.zeros((levels * m, levels * m))
        self._first_turns: Array = np.zeros((levels - 1, m, m))
        self._first_transition: Array = np.zeros((m, m))
        self.penalty: Array = np.empty(self.weights.shape)
        weigh_bounds(self.penalty, self.bounded, self.soft_weights, self.inputs)
        self.active = ActiveBounds.none(self.weights.shape, m)
        self.plan_shapes = (stages + levels - 1, m), (stages - 1, m)
        self.problem = (
            self._rows,
            self._terminal_map,
            self._terminal_cost,
            self._terminal_hessian,
            self._first_turns,
            self._first_transition,
            self._push,
            parameters.gain,
            self.weights,
            self.penalty,
            self._flat,
            self.active.values,
            self.active.side,
            self.active.multipliers,
            parameters.period_s,
            INPUT_PENALTY,
            INPUT_TOLERANCE,
        )

    def unknown_factor(self, bounds: bool) -> Factor:
        """Room for a factor, with active bounds or without."""
        size, width = self._free.stop - self._free.start, self._rows.shape[2]
        rows = self.weights.shape if bounds else (0, self.weights.shape[1])
        return Factor(np.empty((size, width)), np.zeros(rows))

    def balance(self, disturbance: Array) -> Array:
        """What a disturbance, shape (m,), adds to the inputs, as an input, shape (m,)."""
        balance: Array = disturbance / self.parameters.gain
        return balance

    def set_matrices(self, turn: Array, transition: Array, terminal_cost: Array) -> None:
        """Replace E, F and the terminal cost.

        Parameters
        ----------
        turn
            E of the stages 1 to N + levels - 2, shape (.., m, m).
        transition
            F of the stages 1 to N + levels - 3, shape (.., m, m).
        terminal_cost
            Of (position, velocity[, actuator]) at stage N, shape (levels m, levels m).
        """
        period_s = self.parameters.period_s
        rows_of_positions(turn, transition, *self._dynamics, period_s, self._rows, self._terminal_map)
        self._first_turns[:] = turn[: len(self._first_turns)]
        self._first_transition[:] = transition[0]
        self._terminal_cost[:] = terminal_cost
        self._terminal_hessian[:] = self._terminal_map.T @ terminal_cost @ self._terminal_map

    def set_clearances(self, directions: Array) -> None:
        """Replace the rows that keep clear of others.

        Parameters
        ----------
        directions
            Shape (N, K, m); a row is the product with the stage's position. Rows of zeros bind nothing, and
            so do those of the positions that the measured state determines.
        """
        self._rows[:, self._clearances, : self.parameters.axes] = directions
        self.bounded[:, self._clearances] = directions.any(axis=2)
        self.bounded[: self.parameters.levels, self._clearances] = 0.0
        weigh_bounds(self.penalty, self.bounded, self.soft_weights, self.inputs)

    def begin(self, first_state: Array, disturbance: Array, shifted: bool) -> None:
        """Begin a solve from a measured state, which fixes as many positions as it has levels.

        Parameters
        ----------
        first_state
            Position, velocity[, actuator] of stage 1, shape (levels, m).
        disturbance
            Acceleration, shape (m,).
        shifted
            From the present positions one stage on, instead of standing still where the state leads to.
        """
        chain_start(
            self._flat,
            shifted,
            first_state,
            disturbance,
            self._first_turns,
            self._first_transition,
            self._push,
            self.parameters.period_s,
        )

    def point(self) -> Array:
        """The present positions, to come back to."""
        return self.flat.copy()

    def restore(self, point: Array) -> None:
        """Go back to a point."""
        self.flat[:] = point

    def positions(self) -> Array:
        """Positions y, shape (N + levels - 1, m), the first N of which are the stages'."""
        return self.flat[:-1].copy()

    def values(self) -> Array:
        """Rows at the present positions, shape (N, 3 m + K)."""
        return self._values_of(self._flat)

    def change_of_values(self, step: Array) -> Array:
        """Change of the rows under a step of the free positions, shape (N, 3 m + K)."""
        self._change[self._free] = step
        return self._values_of(self._change)

    def _values_of(self, flat: Array) -> Array:
        values = np.empty(self.weights.shape)
        chain_values(self._rows, flat, self.parameters.axes, values)
        return values

    def move(self, step: Array) -> None:
        """Take a step of the free positions."""
        self._flat[self._free] += step

    def roll_out(self, inputs: Array) -> None:
        """Set the free positions to what inputs, balance added, lead to; shape (N - 1, m)."""
        axes = self.parameters.axes
        chain_roll_out(self._rows, inputs.copy(), self._flat, axes, self.inputs.start)

    def step(self, factor: Array, pull: Array, target: ChainTarget) -> Array:
        """Newton step of the free positions with a factor from `factorize`.

        Parameters
        ----------
        pull
            Derivative of all but the terminal cost by the rows, shape (N, 3 m + K).
        """
        step = np.empty(len(factor))
        chain_step(
            self._rows,
            self._flat,
            self._terminal_map,
            self._terminal_cost,
            target.terminal,
            factor,
            pull,
            self._free.start,
            step,
        )
        return step

    def terminal_cost_of(self, target: ChainTarget) -> float:
        """Terminal cost of the present positions."""
        error = self._terminal_error(target)
        return 0.5 * float(error @ self._terminal_cost @ error)

    def _terminal_error(self, target: ChainTarget) -> Array:
        last = self.parameters.stages - 1
        return np.asarray(self._terminal_map @ self.flat[last:-1].reshape(-1) - target.terminal)

    def factorize(self, weights: Array) -> Array | None:
        """Banded Cholesky factor of the Hessian with these row weights; None if it is not definite."""
        m, fixed = self.parameters.axes, self._free.start
        factor = np.empty((self._free.stop - fixed, self._rows.shape[2]))
        definite = chain_factor(self._rows, weights, self._terminal_hessian, m, fixed, factor)
        return factor if definite else None
