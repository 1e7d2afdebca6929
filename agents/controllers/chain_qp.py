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
from agents.controllers.chain_interior_point import InteriorPoint
from vehicles.state import Array

INPUT_PENALTY: Final = 1e6
"""Penalty parameter of the augmented Lagrangian, against input weights of about one."""
INPUT_TOLERANCE: Final = 1e-5
"""Largest violation of an input bound that counts as solved; what is left is cut off."""
ACTIVE_SET_STEPS: Final = 5
READABLE_GAPS: Final = (1e-2, 1e-4, 1e-6)
"""Mean complementarities at which the active bounds are read off an interior point; the last one is exact."""


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
        self._can_press = chain.bounded > 0.0
        self._side: Array | None = None
        self._multipliers: Array = np.zeros((parameters.stages, parameters.axes))
        self._factor: Array | None = None
        self._factor_side: Array | None = None
        self._warm = False

    def set_matrices(self, turn: Array, transition: Array, terminal_cost: Array) -> None:
        """Replace E, F and the terminal cost (`Chain.set_matrices`)."""
        self._chain.set_matrices(turn, transition, terminal_cost)
        self._factor = None

    def balance(self, disturbance: Array) -> Array:
        """What a disturbance adds to the inputs (`Chain.balance`)."""
        return self._chain.balance(disturbance)

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._warm = False

    def solve(self, first_state: Array, disturbance: Array, target: ChainTarget) -> ChainSolution:
        """Solve with new numbers, starting from the last solution shifted by one stage.

        Parameters
        ----------
        first_state
            Position, velocity[, actuator] of stage 1, shape (levels, m).
        disturbance
            Acceleration that acts at every stage, shape (m,).
        target
            Reference and bounds.

        Returns
        -------
        ChainSolution
            The minimiser, or the best point found.
        """
        chain = self._chain
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
        inputs = chain.values()[:-1, chain.inputs]
        if not solved:
            inputs = np.clip(inputs, target.lower[chain.inputs], target.upper[chain.inputs])
            chain.roll_out(inputs)
        return ChainSolution(chain.flat[:-1].copy(), inputs - chain.balance(disturbance), solved, iterations)

    def _shift(self) -> None:
        """Move the last solution on by one stage."""
        if not self._warm:
            self._side = None
            return
        self._chain.flat[:-2] = self._chain.flat[1:-1]
        if self._side is not None:
            self._multipliers[:-2] = self._multipliers[1:-1]
            self._side[:-1] = self._side[1:]
            self._side *= self._chain.bounded

    def _active_set(self, target: ChainTarget) -> tuple[bool, int]:
        """Semismooth Newton steps between multiplier updates; False if they do not settle."""
        chain = self._chain
        values = chain.values()
        for iteration in range(1, ACTIVE_SET_STEPS + 1):
            step = self._newton_step(values, target)
            if step is None:
                return False, iteration
            chain.move(step)
            values = chain.values()
            side = self._pressed_side(values, target)
            settled = _same(side, self._side)
            self._side = side
            if settled and self._update_multipliers(values, target):
                return True, iteration
        return False, ACTIVE_SET_STEPS

    def _newton_step(self, values: Array, target: ChainTarget) -> Array | None:
        """Step to the minimum with the present side's bounds active; None if there is none."""
        chain, side = self._chain, self._side
        pull = chain.weights * (values - target.rows)
        if side is None:
            weights = chain.weights
        else:
            active = self._penalty * np.abs(side)
            weights = chain.weights + active
            pull += active * (values - np.where(side > 0.0, target.upper, target.lower))
            pull[:, chain.inputs] += np.abs(side[:, chain.inputs]) * self._multipliers
        if self._factor is None or not _same(side, self._factor_side):
            self._factor, self._factor_side = chain.factorize(weights), side
            if self._factor is None:
                return None
        return chain.solve(self._factor, -chain.cost_gradient(pull, target))

    def _pressed_side(self, values: Array, target: ChainTarget) -> Array | None:
        """Which bound each row presses on: -1 lower, 1 upper, 0 none; None if no row presses on any."""
        pressed = values
        if self._side is not None:
            pressed = values.copy()
            pressed[:, self._chain.inputs] += self._multipliers / INPUT_PENALTY
        above, below = pressed > target.upper, pressed < target.lower
        above &= self._can_press
        below &= self._can_press
        if above.any() or below.any():
            return above.astype(float) - below
        return None

    def _update_multipliers(self, values: Array, target: ChainTarget) -> bool:
        """One step of the method of multipliers; True if the input bounds hold."""
        if self._side is None:
            self._multipliers[:] = 0.0
            return True
        columns = self._chain.inputs
        inputs, lower, upper = values[:-1, columns], target.lower[columns], target.upper[columns]
        violation = np.maximum(inputs - upper, lower - inputs).max()
        pressed = inputs + self._multipliers[:-1] / INPUT_PENALTY
        self._multipliers[:-1] = INPUT_PENALTY * (pressed - np.clip(pressed, lower, upper))
        return bool(violation <= INPUT_TOLERANCE)

    def _interior_point(self, target: ChainTarget) -> tuple[bool, int]:
        """Interior-point steps until the active bounds can be read off and give the exact solution."""
        method = InteriorPoint(self._chain, target)
        for gap in READABLE_GAPS:
            closed = method.run(gap, self._max_iterations)
            inside = self._chain.flat.copy()
            self._take_over(method)
            solved, _ = self._active_set(target)
            if solved:
                return True, method.iterations
            self._chain.flat[:] = inside
            if not closed:
                break
        return closed, method.iterations

    def _take_over(self, method: InteriorPoint) -> None:
        """Active bounds and multipliers of an interior point."""
        pressing = method.multipliers > method.slacks
        self._side = pressing[0].astype(float) - pressing[1]
        upper, lower = method.multipliers * pressing
        self._multipliers[:] = (upper - lower)[:, self._chain.inputs]
        self._factor = None


def _same(one: Array | None, other: Array | None) -> bool:
    if one is None or other is None:
        return one is other
    return bool((one == other).all())
