"""The horizontal problem of a vehicle with a tilt model, condensed to its demands.

In the inertial frame the prediction is linear and knows no heading (`rcopterx.agents.flight.lateral`): every
position and velocity of the horizon is a constant row times the demands e_1 .. e_{N-1}, and so is the
Hessian, which is factorised once for all flights. The heading turns only what is given in the body frame:
stick limits, velocity bounds. The class offers what `ChainQP` and `InteriorPoint` need, as `Chain` does for
vehicles with lags.
"""

from typing import Final

import numpy as np
from scipy.linalg import lapack, solve_discrete_are

from rcopterx.agents.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.agents.flight.lateral import POSITION, VELOCITY, LateralSystem
from rcopterx.native.lateral import add_stick_weights, lateral_pull, lateral_rows
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
    """

    def __init__(self, parameters: ChainParameters, system: LateralSystem) -> None:
        self.parameters = parameters
        self._system = system
        stages = parameters.stages
        self._free = AXES * (stages - 1)
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
        self._demands: Array = np.zeros(self._free)
        self._condense()
        self.terminal_cost = self._riccati_cost()
        self._hessian = self._constant_hessian()
        self._factor = _cholesky(self._hessian.copy())
        level = np.tile(np.eye(AXES), (stages, 1, 1))
        self.set_headings(level, level[:-1])
        self.set_start(np.zeros(system.size))

    def _condense(self) -> None:
        """Maps from the demands and from the first state to positions, velocities and the last state."""
        system, stages = self._system, self.parameters.stages
        size, count = system.size, stages + BEYOND
        powers = np.empty((count, size, size))
        powers[0] = np.eye(size)
        for stage in range(1, count):
            powers[stage] = system.transition @ powers[stage - 1]
        positions, velocities = powers[:, POSITION].reshape(-1, size), powers[:stages, VELOCITY]
        self._state_map = np.ascontiguousarray(
            np.concatenate((positions[: AXES * stages], velocities.reshape(-1, size), powers[stages - 1]))
        )
        self._beyond_state_map = np.ascontiguousarray(positions[AXES * stages :])
        pushed = powers @ system.demand
        demand = np.zeros((count, size, stages - 1, AXES))
        for stage in range(1, count):
            known = min(stage, stages - 1)
            demand[stage, :, :known] = pushed[stage - known : stage][::-1].transpose(1, 0, 2)
            for beyond in range(stage - known):
                demand[stage, :, -1] += pushed[beyond]
        flat = demand.reshape(count, size, self._free)
        positions, velocities = flat[:, POSITION].reshape(AXES * count, -1), flat[:stages, VELOCITY]
        beyond = AXES * stages
        # Positions and velocities of the stages, the last state: one product with the demands gives all.
        self._map = np.ascontiguousarray(
            np.concatenate((positions[:beyond], velocities.reshape(beyond, -1), flat[stages - 1]))
        )
        self._position_map, self._velocity_map = self._map[:beyond], self._map[beyond : 2 * beyond]
        self._last_map = self._map[2 * beyond :]
        self._beyond_map = np.ascontiguousarray(positions[beyond:])
        self._pulled: Array = np.zeros(len(self._map))

    def _riccati_cost(self) -> Array:
        """Cost of the last state: what an endless horizon would add."""
        system = self._system
        weights = np.zeros(system.size)
        weights[POSITION], weights[VELOCITY] = self._position_weight, self._velocity_weight
        cost = solve_discrete_are(
            system.transition, system.demand, np.diag(weights), self._demand_weight * np.eye(AXES)
        )
        return np.asarray(0.5 * (cost + cost.T))

    def _constant_hessian(self) -> Array:
        stages = self.parameters.stages
        inner = slice(AXES, AXES * (stages - 1))
        positions, velocities = self._position_map[inner], self._velocity_map[inner]
        hessian = self._position_weight * positions.T @ positions
        hessian += self._velocity_weight * velocities.T @ velocities
        hessian += self._last_map.T @ self.terminal_cost @ self._last_map
        hessian[np.diag_indices(self._free)] += self._demand_weight
        return np.asarray(hessian)

    @property
    def gain(self) -> Array:
        """Feedback of the first demand on the state when no bound is active: e = -gain x, shape (2, n)."""
        system, cost = self._system, self.terminal_cost
        effort = self._demand_weight * np.eye(AXES) + system.demand.T @ cost @ system.demand
        return np.asarray(np.linalg.solve(effort, system.demand.T @ cost @ system.transition))

    def set_headings(self, turn: Array, demand_turn: Array) -> None:
        """Replace the headings of the horizon.

        Parameters
        ----------
        turn
            R(psi) of the stages, shape (N, 2, 2).
        demand_turn
            R(psi) in the middle of the periods, shape (N - 1, 2, 2).
        """
        self._turn, self._demand_turn = turn, demand_turn

    def set_clearances(self, directions: Array) -> None:
        """Replace the rows that keep clear of others, shape (N, K, 2) (`Chain.set_clearances`)."""
        self._directions = directions
        self.bounded[:, self._clearances] = directions.any(axis=2)
        self.bounded[:1, self._clearances] = 0.0

    def set_start(self, first_state: Array) -> None:
        """Start from a state of the lateral system, shape (n,)."""
        self._base = self._state_map @ first_state
        self._beyond_base = self._beyond_state_map @ first_state

    def rest(self) -> None:
        """Begin from no demand at all."""
        self._demands[:] = 0.0

    def shift(self) -> None:
        """Begin one stage on."""
        self._demands[:-AXES] = self._demands[AXES:].copy()

    def point(self) -> Array:
        """The present demands, to come back to."""
        return self._demands.copy()

    def restore(self, point: Array) -> None:
        """Go back to a point."""
        self._demands[:] = point

    def positions(self) -> Array:
        """Positions of the stages and `BEYOND` more, shape (N + 2, 2)."""
        stages = self._base[: AXES * self.parameters.stages] + self._position_map @ self._demands
        beyond = self._beyond_base + self._beyond_map @ self._demands
        return np.concatenate((stages, beyond)).reshape(-1, AXES)

    def values(self) -> Array:
        """Rows at the present demands, shape (N, 6 + K)."""
        return self._rows(self._base + self._map @ self._demands, self._demands)

    def change_of_values(self, step: Array) -> Array:
        """Change of the rows under a step of the demands, shape (N, 6 + K)."""
        return self._rows(self._map @ step, step)

    def _rows(self, moved: Array, demands: Array) -> Array:
        rows = np.empty(self.weights.shape)
        lateral_rows(
            moved, demands, self._turn, self._demand_turn, self.parameters.gain, self._directions, rows
        )
        return rows

    def move(self, step: Array) -> None:
        """Take a step of the demands."""
        self._demands += step

    def roll_out(self, inputs: Array) -> None:
        """Demand what sticks ask for, trim included; shape (N - 1, 2)."""
        demands = np.einsum("sab,sb->sa", self._demand_turn, inputs * self.parameters.gain)
        self._demands[:] = demands.reshape(-1)

    def gradient(self, pull: Array) -> Array:
        """Derivative with respect to the demands of sum(pull * rows), both of the same shape."""
        self._pulled[-self._system.size :] = 0.0
        return self._gradient(pull)

    def cost_gradient(self, pull: Array, target: ChainTarget) -> Array:
        """As `gradient`, with the terminal cost's part."""
        self._pulled[-self._system.size :] = self.terminal_cost @ self._terminal_error(target)
        return self._gradient(pull)

    def _gradient(self, pull: Array) -> Array:
        gradient = np.empty(self._free)
        lateral_pull(
            pull,
            self._turn,
            self._demand_turn,
            self.parameters.gain,
            self._directions,
            self._pulled,
            gradient,
        )
        gradient += self._pulled @ self._map
        return gradient

    def terminal_cost_of(self, target: ChainTarget) -> float:
        """Terminal cost of the present demands."""
        error = self._terminal_error(target)
        return 0.5 * float(error @ self.terminal_cost @ error)

    def _terminal_error(self, target: ChainTarget) -> Array:
        last = self._base[-self._system.size :] + self._last_map @ self._demands
        return np.asarray(last - target.terminal)

    def factorize(self, weights: Array) -> Array | None:
        """Cholesky factor of the Hessian with these row weights; None if it is not definite."""
        if weights is self.weights:
            return self._factor
        added = weights - self.weights
        hessian = self._hessian.copy()
        add_stick_weights(hessian, added, self._demand_turn, self.parameters.gain, self.inputs.start)
        for rows in self._active_rows(added):
            hessian += rows.T @ rows
        return _cholesky(hessian)

    def _active_rows(self, added: Array) -> list[Array]:
        """Rows of positions, velocities and clearances with weight, times its square root."""
        stages, found = self.parameters.stages, []
        positions = self._position_map[: AXES * stages].reshape(stages, AXES, -1)
        velocities = self._velocity_map.reshape(stages, AXES, -1)
        for columns, directions, maps in (
            (slice(0, AXES), np.broadcast_to(np.eye(AXES), (stages, AXES, AXES)), positions),
            (slice(AXES, 2 * AXES), self._turn.transpose(0, 2, 1), velocities),
            (self._clearances, self._directions, positions),
        ):
            stage, row = np.nonzero(added[:, columns])
            if len(stage):
                scale = np.sqrt(added[:, columns][stage, row])[:, None]
                found.append(np.einsum("ra,raf->rf", directions[stage, row] * scale, maps[stage]))
        return found

    @staticmethod
    def solve(factor: Array, right_side: Array) -> Array:
        """Solve with a factor from `factorize`."""
        return np.asarray(lapack.dpotrs(factor, right_side, lower=1)[0])


def _cholesky(hessian: Array) -> Array | None:
    """Cholesky factor in the place of a matrix; None if it is not definite."""
    # Transposed it is the same matrix, and LAPACK need not copy it.
    factor, info = lapack.dpotrf(hessian.T, lower=1, overwrite_a=1)
    return None if info else factor
