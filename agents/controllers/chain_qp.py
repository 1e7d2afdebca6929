"""Solver of a chain's quadratic program: hard input bounds, soft state bounds.

Inside its bounds the problem is solved by one factorisation, which is kept as long as the matrices stay.
With bounds active, the first guess is that those of the previous solution, one stage on, are active again:
semismooth Newton steps on the augmented Lagrangian settle in one to four factorisations. When they do not
settle (a set point was moved), a primal-dual interior-point method solves from scratch.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from agents.controllers.chain import Chain, ChainParameters, ChainTarget
from agents.controllers.chain_interior_point import solve_interior_point
from vehicles.state import Array

INPUT_PENALTY: Final = 1e6
"""Penalty parameter of the augmented Lagrangian, against input weights of about one."""
INPUT_TOLERANCE: Final = 1e-5
"""Largest violation of an input bound that counts as solved; what is left is cut off."""
ACTIVE_SET_STEPS: Final = 8
UNBOUNDED: Final = 1e9
"""Stand-in for an infinite bound."""


@dataclass(frozen=True, slots=True)
class ChainSolution:
    """What was found.

    Attributes
    ----------
    flat
        Positions y, shape (N + levels - 1, m), the first N of which are the stages'.
    inputs
        Shape (N - 1, m), within their bounds to `INPUT_TOLERANCE` if solved.
    solved
        False if the iterations ran out.
    iterations
        Newton steps.
    """

    flat: Array
    inputs: Array
    solved: bool
    iterations: int


class ChainQP:
    """Workspace of one chain.

    Parameters
    ----------
    parameters
        Sizes, dynamics and weights.
    max_iterations
        Interior-point steps after which the best point is returned unsolved.
    """

    def __init__(self, parameters: ChainParameters, max_iterations: int) -> None:
        self._chain = chain = Chain(parameters)
        self._max_iterations = max_iterations
        self._penalty: Array = chain.bounded * parameters.soft_weight
        self._penalty[:, chain.inputs] = chain.bounded[:, chain.inputs] * INPUT_PENALTY
        self._multipliers: Array = np.zeros((parameters.stages, parameters.axes))
        self._side: Array = np.zeros((parameters.stages, 3 * parameters.axes))
        self._factor: Array | None = None
        self._factor_active: Array = np.zeros(self._side.shape, dtype=bool)
        self._warm = False

    def set_matrices(self, turn: Array, transition: Array, terminal_cost: Array) -> None:
        """Replace E, F and the terminal cost (`Chain.set_matrices`)."""
        self._chain.set_matrices(turn, transition, terminal_cost)
        self._factor = None

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._warm = False

    def solve(
        self,
        first_state: Array,
        disturbance: Array,
        reference: tuple[Array, Array],
        bounds: tuple[Array, Array],
    ) -> ChainSolution:
        """Solve with new numbers, starting from the last solution shifted by one stage.

        Parameters
        ----------
        first_state
            Position, velocity[, actuator] of stage 1, shape (levels, m).
        disturbance
            Acceleration that acts at every stage, shape (m,).
        reference
            Rows, shape (N, 3 m): position, velocity and input; and the terminal (position, velocity
            [, actuator]), shape (levels m,).
        bounds
            Lower and upper, shape (3 m,), of position, velocity and input.

        Returns
        -------
        ChainSolution
            The minimiser, or the best point found.
        """
        chain = self._chain
        balance = chain.balance(disturbance)
        target = self._without_balance(reference, bounds, balance)
        self._shift()
        chain.set_start(first_state, disturbance)
        if not self._warm:
            levels = chain.parameters.levels
            chain.flat[levels:-1] = chain.flat[levels - 1]
        solved, iterations = self._active_set(target)
        if not solved:
            solved, further = self._interior_point(target)
            iterations += further
        self._warm = True
        inputs = chain.values()[:-1, chain.inputs] - balance
        if not solved:
            columns = chain.inputs
            inputs = np.clip(inputs, bounds[0][columns], bounds[1][columns])
            chain.roll_out(inputs + balance)
        return ChainSolution(chain.flat[:-1].copy(), inputs, solved, iterations)

    def _without_balance(
        self, reference: tuple[Array, Array], bounds: tuple[Array, Array], balance: Array
    ) -> ChainTarget:
        """Inputs and actuators both carry the disturbance's balance as a constant; take it out."""
        rows, terminal = reference[0].copy(), reference[1].copy()
        lower, upper = bounds[0].copy(), bounds[1].copy()
        for part in (rows, lower, upper):
            part[..., self._chain.inputs] += balance
        np.clip(lower, -UNBOUNDED, UNBOUNDED, out=lower)
        np.clip(upper, -UNBOUNDED, UNBOUNDED, out=upper)
        terminal[2 * self._chain.parameters.axes :] += balance if self._chain.parameters.levels == 3 else 0.0
        return ChainTarget(rows, terminal, lower, upper)

    def _shift(self) -> None:
        if not self._warm:
            self._multipliers[:] = 0.0
            self._side[:] = 0.0
            return
        self._chain.flat[:-2] = self._chain.flat[1:-1]
        self._multipliers[:-2] = self._multipliers[1:-1]
        self._side[:-1] = self._side[1:]
        self._side *= self._chain.bounded

    def _active_set(self, target: ChainTarget) -> tuple[bool, int]:
        """Semismooth Newton steps between multiplier updates; False if they do not settle."""
        chain, side = self._chain, self._side
        values = chain.values()
        for iteration in range(1, ACTIVE_SET_STEPS + 1):
            step = self._newton_step(values, target)
            if step is None:
                return False, iteration
            chain.move(step)
            values = chain.values()
            side_now = self._pressed_side(values, target)
            settled = bool((side_now == side).all())
            side[:] = side_now
            if settled and self._update_multipliers(values, target):
                return True, iteration
        return False, ACTIVE_SET_STEPS

    def _newton_step(self, values: Array, target: ChainTarget) -> Array | None:
        chain, side = self._chain, self._side
        active = side != 0.0
        if self._factor is None or not np.array_equal(active, self._factor_active):
            self._factor = chain.factorize(chain.weights + active * self._penalty)
            self._factor_active = active
            if self._factor is None:
                return None
        pull = chain.weights * (values - target.rows)
        if active.any():
            pull += active * self._penalty * (values - np.where(side > 0, target.upper, target.lower))
            pull[:, chain.inputs] += active[:, chain.inputs] * self._multipliers
        return chain.solve(self._factor, -chain.cost_gradient(pull, target))

    def _pressed_side(self, values: Array, target: ChainTarget) -> Array:
        """Which bound each row presses on: -1 lower, 1 upper, 0 none."""
        pressed = values.copy()
        pressed[:, self._chain.inputs] += self._multipliers / INPUT_PENALTY
        above, below = pressed > target.upper, pressed < target.lower
        return np.asarray((above.astype(float) - below) * self._chain.bounded)

    def _update_multipliers(self, values: Array, target: ChainTarget) -> bool:
        """One step of the method of multipliers; True if the input bounds hold."""
        columns = self._chain.inputs
        inputs, lower, upper = values[:-1, columns], target.lower[columns], target.upper[columns]
        violation = np.maximum(inputs - upper, lower - inputs).max()
        pressed = inputs + self._multipliers[:-1] / INPUT_PENALTY
        self._multipliers[:-1] = INPUT_PENALTY * (pressed - np.clip(pressed, lower, upper))
        return bool(violation <= INPUT_TOLERANCE)

    def _interior_point(self, target: ChainTarget) -> tuple[bool, int]:
        found = solve_interior_point(self._chain, target, self._max_iterations)
        upper, lower = found.multipliers
        pressing = found.multipliers > found.slacks
        self._side[:] = pressing[0].astype(float) - pressing[1]
        self._multipliers[:] = ((upper - lower) * pressing.any(axis=0))[:, self._chain.inputs]
        self._factor = None
        return found.solved, found.iterations
