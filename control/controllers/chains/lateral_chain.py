"""The horizontal problem of a vehicle with a tilt model, in its demands.

In the inertial frame the prediction is linear, the same at every stage, and knows no heading
(`rcopterx.control.models.lateral`). The heading turns only what is given in the body frame: stick limits,
velocity bounds. Without active bounds the solution is the regulator of the endless horizon, computed once for
all flights; active bounds change weights of stages, and a Riccati recursion gives the feedback with them. The
class offers what `ChainQP` and `InteriorPoint` need, as `Chain` does for vehicles with lags.
"""

from typing import Final

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.controllers.chains.chain import (
    INPUT_PENALTY,
    INPUT_TOLERANCE,
    ActiveBounds,
    ChainParameters,
    ChainTarget,
    Factor,
    weigh_bounds,
)
from rcopterx.control.models.lateral import POSITION, VELOCITY, LateralSystem
from rcopterx.native.lateral import (
    lateral_begin,
    lateral_factor,
    lateral_rows,
    lateral_states,
    lateral_step,
)
from rcopterx.native.settling import lateral_attempt
from rcopterx.vehicles.state import Array

AXES: Final = 2
BEYOND: Final = 2
"""Positions after the last stage, from which its velocity and acceleration follow; the last demand goes
on."""


class LateralChain:
    """Rows, cost and Hessian of the horizontal problem; see `Chain` for what the members mean.

    Rows of a stage are position (inertial frame), velocity (body frame), stick (trim included), clearances.

    Parameters
    ----------
    parameters
        Sizes and weights; those of x and y are averaged, because the prediction does not prefer a direction.
    system
        The prediction over one control period.

    Attributes
    ----------
    turn, demand_turn
        R(psi) of the stages, shape (N, 2, 2), and in the middle of the periods, shape (N - 1, 2, 2); to be
        written ahead of a solve.
    """

    attempt = staticmethod(lateral_attempt)

    def __init__(self, parameters: ChainParameters, system: LateralSystem) -> None:
        self.parameters = parameters
        self._system = system
        stages = parameters.stages
        self.inputs = slice(2 * AXES, 3 * AXES)
        self._clearances = slice(3 * AXES, 3 * AXES + parameters.clearances)
        rows = self._clearances.stop
        gain = parameters.gain
        self._position_weight = float(parameters.position_weights.mean())
        self._velocity_weight = float(parameters.velocity_weights.mean())
        self._demand_weight = float((parameters.input_weights / gain**2).mean())
        self.weights: Array = np.zeros((stages, rows))
        self.weights[1:-1, :AXES] = self._position_weight
        self.weights[1:-1, AXES : 2 * AXES] = self._velocity_weight
        self.weights[:-1, self.inputs] = self._demand_weight * gain**2
        # the measured first state and the input after the horizon cannot be chosen, so no bound binds them
        self.bounded: Array = np.ones((stages, rows))
        self.bounded[0, : 2 * AXES] = 0.0
        self.bounded[-1, self.inputs] = 0.0
        self.bounded[:, :AXES] *= parameters.position_bounded
        self.bounded[:, self._clearances] = 0.0
        self.soft_weights: Array = np.full(rows, parameters.soft_weight)
        self.soft_weights[self._clearances] = parameters.clearance_weight
        self._directions: Array = np.zeros((stages, parameters.clearances, AXES))
        self._demands: Array = np.zeros(AXES * (stages - 1))
        self._transition = np.ascontiguousarray(system.transition)
        self._carried = np.ascontiguousarray(system.transition.T)
        self._demand = np.ascontiguousarray(system.demand)
        self._states: Array = np.zeros((stages + BEYOND, system.size))
        """Always those of the present demands."""
        self.terminal_cost = self._riccati_cost()
        self._endless = self._endless_factor()
        self.turn: Array = np.tile(np.eye(AXES), (stages, 1, 1))
        self.demand_turn: Array = self.turn[:-1].copy()
        self.penalty: Array = np.empty(self.weights.shape)
        weigh_bounds(self.penalty, self.bounded, self.soft_weights, self.inputs)
        self.active = ActiveBounds.none(self.weights.shape, AXES)
        self.plan_shapes = (stages + BEYOND, AXES), (stages - 1, AXES)
        self.problem = (
            self._transition,
            self._carried,
            self._demand,
            self.terminal_cost,
            self._endless,
            self.turn,
            self.demand_turn,
            gain,
            self._directions,
            self.weights,
            self.penalty,
            self._demands,
            self._states,
            self.active.values,
            self.active.side,
            self.active.multipliers,
            INPUT_PENALTY,
            INPUT_TOLERANCE,
        )

    def unknown_factor(self, bounds: bool) -> Factor:
        """See `Chain.unknown_factor`."""
        shape = len(self.weights) - 1, AXES, self._system.size + AXES
        rows = self.weights.shape if bounds else (0, self.weights.shape[1])
        return Factor(np.empty(shape), np.zeros(rows))

    def balance(self, trim: Array) -> Array:
        """What the offsets of the sticks, shape (2,), add to the inputs: themselves."""
        return trim

    def _riccati_cost(self) -> Array:
        """Cost of the last state: what an endless horizon would add."""
        system = self._system
        weights = np.zeros(system.size)
        weights[POSITION], weights[VELOCITY] = self._position_weight, self._velocity_weight
        effort = self._demand_weight * np.eye(AXES)
        return np.asarray(
            solve_discrete_are(system.transition, system.demand, np.diag(weights), effort), dtype=float
        )

    def _endless_factor(self) -> Array:
        """Feedback of the endless horizon, and the inverse of what a demand costs: what a factor has."""
        demand, cost = self._demand, self.terminal_cost
        inverse = np.linalg.inv(self._demand_weight * np.eye(AXES) + demand.T @ cost @ demand)
        return np.hstack((inverse @ demand.T @ cost @ self._transition, inverse))

    @property
    def gain(self) -> Array:
        """Feedback of the first demand on the state when no bound is active: e = -gain x, shape (2, n)."""
        return self._endless[:, : self._system.size]

    def set_clearances(self, directions: Array) -> None:
        """Replace the rows that keep clear of others, shape (N, K, 2) (`Chain.set_clearances`)."""
        self._directions[:] = directions
        self.bounded[:, self._clearances] = directions.any(axis=2)
        self.bounded[:1, self._clearances] = 0.0
        weigh_bounds(self.penalty, self.bounded, self.soft_weights, self.inputs)

    def begin(
        self,
        first_state: Array,
        trim: Array,  # noqa: ARG002 - of what the sticks are, not of where they lead
        shifted: bool,
    ) -> None:
        """Begin a solve from a state of the lateral system, shape (n,).

        Parameters
        ----------
        shifted
            With the present demands one stage on, instead of none at all.
        """
        lateral_begin(self._carried, self._demand, first_state, shifted, self._demands, self._states)

    def point(self) -> Array:
        """The present demands, to come back to."""
        return self._demands.copy()

    def restore(self, point: Array) -> None:
        """Go back to a point."""
        self._demands[:] = point
        self._follow()

    def positions(self) -> Array:
        """Positions of the stages and `BEYOND` more, shape (N + 2, 2)."""
        return self._states[:, POSITION].copy()

    def values(self) -> Array:
        """Rows at the present demands, shape (N, 6 + K)."""
        return self._rows(self._demands, self._states)

    def change_of_values(self, step: Array) -> Array:
        """Change of the rows under a step of the demands, shape (N, 6 + K)."""
        change = np.empty(self._states.shape)
        lateral_states(self._carried, self._demand, np.zeros(self._system.size), step, change)
        return self._rows(step, change)

    def _rows(self, demands: Array, states: Array) -> Array:
        rows = np.empty(self.weights.shape)
        lateral_rows(
            states, demands, self.turn, self.demand_turn, self.parameters.gain, self._directions, rows
        )
        return rows

    def _follow(self) -> None:
        """Renew the states."""
        first_state = self._states[0].copy()
        lateral_states(self._carried, self._demand, first_state, self._demands, self._states)

    def move(self, step: Array) -> None:
        """Take a step of the demands."""
        self._demands += step
        self._follow()

    def roll_out(self, inputs: Array) -> None:
        """Demand what sticks ask for, trim included; shape (N - 1, 2)."""
        demands = np.einsum("sab,sb->sa", self.demand_turn, inputs * self.parameters.gain)
        self._demands[:] = demands.reshape(-1)
        self._follow()

    def terminal_cost_of(self, target: ChainTarget) -> float:
        """Terminal cost of the present demands."""
        error = self._terminal_error(target)
        return 0.5 * float(error @ self.terminal_cost @ error)

    def _terminal_error(self, target: ChainTarget) -> Array:
        return np.asarray(self._states[self.parameters.stages - 1] - target.terminal)

    def factorize(self, weights: Array) -> Array | None:
        """Factor of the Hessian with these row weights; None if it is not definite."""
        factor = np.empty((len(weights) - 1, *self._endless.shape))
        definite = lateral_factor(
            self._transition,
            self._demand,
            self.terminal_cost,
            self._endless,
            self.weights,
            weights,
            self.turn,
            self.demand_turn,
            self.parameters.gain,
            self._directions,
            factor,
        )
        return factor if definite else None

    def step(self, factor: Array, pull: Array, target: ChainTarget) -> Array:
        """Newton step of the demands with a factor from `factorize` (`Chain.step`)."""
        step = np.empty(len(self._demands))
        lateral_step(
            self._transition,
            self._carried,
            self._demand,
            factor,
            pull,
            self.terminal_cost @ self._terminal_error(target),
            self.turn,
            self.demand_turn,
            self.parameters.gain,
            self._directions,
            step,
            np.empty(self._states.shape),
        )
        return step
