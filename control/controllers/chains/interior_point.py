"""Primal-dual interior-point method (Mehrotra's predictor and corrector) for a chain's quadratic program.

Every bounded row v has two inequalities, v - z/w + t = upper and -v - z/w + t = -lower, with slack t and
multiplier z both positive; 1/w is zero for a hard bound, and the inverse penalty weight for a soft one, whose
excess z/w is thereby eliminated. Each step costs one banded factorisation and two solves.
"""

from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from rcopterx.control.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.native.interior import complementarity_ahead, direction_of, residual_of, shift_of, softened_of
from rcopterx.vehicles.state import Array

RESIDUAL: Final = 1e-7
START_MULTIPLIER: Final = 10.0
START_SLACK: Final = 0.1
TO_BOUNDARY: Final = 0.99
_LONGEST: Final = 1.0 / TO_BOUNDARY


class StageProblem(Protocol):
    """Rows and cost of a problem, and its point; see `Chain` for what the members mean."""

    parameters: ChainParameters
    weights: Array
    bounded: Array
    soft_weights: Array
    inputs: slice

    def point(self) -> Array:
        """The present point, to come back to."""
        ...

    def restore(self, point: Array) -> None:
        """Go back to a point."""
        ...

    def positions(self) -> Array:
        """Positions of the stages and further ones that their accelerations need."""
        ...

    def values(self) -> Array:
        """Rows at the present point."""
        ...

    def change_of_values(self, step: Array) -> Array:
        """Change of the rows under a step."""
        ...

    def move(self, step: Array) -> None:
        """Take a step."""
        ...

    def roll_out(self, inputs: Array) -> None:
        """Go to the point that inputs lead to."""
        ...

    def terminal_cost_of(self, target: ChainTarget) -> float:
        """Terminal cost of the present point."""
        ...

    def factorize(self, weights: Array) -> Array | None:
        """Factor of the Hessian with row weights; None if it is not definite."""
        ...

    def step(self, factor: Array, pull: Array, target: ChainTarget) -> Array:
        """Newton step with a factor, where the derivative by the rows is `pull`."""
        ...


class InteriorPoint:
    """Iteration from the chain's present positions, which it moves to the solution.

    Parameters
    ----------
    chain
        The problem.
    target
        Reference and bounds.

    Attributes
    ----------
    slacks, multipliers
        Shape (2, N, 3 m + K): upper and lower bounds.
    iterations
        Factorisations so far.
    """

    def __init__(self, chain: StageProblem, target: ChainTarget) -> None:
        self._chain, self._target = chain, target
        self._mask = np.stack((chain.bounded, chain.bounded))
        self._count = self._mask.sum()
        self._give = chain.bounded / chain.soft_weights
        self._give[:, chain.inputs] = 0.0
        shape = chain.bounded.shape
        bounds = np.stack((np.broadcast_to(target.upper, shape), -np.broadcast_to(target.lower, shape)))
        self._bounds = np.where(self._mask > 0, bounds, 0.0)
        span = np.where(chain.bounded > 0, target.upper - target.lower, 1.0)
        self._values = chain.values()
        room = self._bounds - np.stack((self._values, -self._values))
        self.slacks: Array = np.where(self._mask > 0, np.maximum(room, START_SLACK * span), 1.0)
        self.multipliers: Array = self._mask * START_MULTIPLIER * span / self.slacks
        self.iterations = 0

    def run(self, gap: float, max_iterations: int, expired: Callable[[], bool]) -> bool:
        """Iterate until the mean complementarity is below a gap.

        Parameters
        ----------
        gap
            Complementarity to reach; costs are of the order of one.
        max_iterations
            Largest number of iterations, those of earlier runs included.
        expired
            Whether to stop, asked before every iteration.

        Returns
        -------
        bool
            Whether it was reached.
        """
        while True:
            residual, largest, together = residual_of(
                self._values, self.multipliers, self._give, self.slacks, self._bounds, self._mask
            )
            present = together / self._count
            if present < gap and largest < RESIDUAL:
                return True
            if self.iterations >= max_iterations or expired() or not self._step(residual, present):
                return False
            self.iterations += 1

    def _step(self, residual: Array, gap: float) -> bool:
        """One predictor and corrector; False if the Hessian cannot be factorised."""
        chain, slacks, multipliers = self._chain, self.slacks, self.multipliers
        softened, stiffness, weights, pull = softened_of(
            slacks, multipliers, self._give, self._values, self._target.rows, chain.weights
        )
        factor = chain.factorize(weights)
        if factor is None:
            return False

        def direction(product: Array) -> tuple[Array, Array, Array, Array, float]:
            shift, pushed = shift_of(stiffness, residual, product, softened)
            step = chain.step(factor, pull + pushed, self._target)
            values = chain.change_of_values(step)
            ahead = direction_of(
                values, self._give, stiffness, shift, residual, self._mask, slacks, multipliers, _LONGEST
            )
            return step, values, *ahead

        product = slacks * multipliers
        _, _, to_slacks, to_multipliers, length = direction(product)
        ahead = complementarity_ahead(slacks, multipliers, to_slacks, to_multipliers, length) / self._count
        centering = (ahead / gap) ** 3
        product += (to_slacks * to_multipliers - centering * gap) * self._mask
        step, values, to_slacks, to_multipliers, length = direction(product)
        length *= TO_BOUNDARY
        chain.move(length * step)
        self._values = self._values + length * values
        slacks += length * to_slacks
        multipliers += length * to_multipliers
        return True
