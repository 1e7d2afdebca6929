"""Quadratic program of a chain of integrators (see `chain`): vehicles with lags, the vertical, yaw."""

from rcopterx.control.controllers.chains.active_set import ActiveSetQP
from rcopterx.control.controllers.chains.chain import Chain, ChainParameters
from rcopterx.vehicles.state import Array


class ChainQP(ActiveSetQP[Chain]):
    """Workspace of one chain.

    It solves from position, velocity[, actuator] of stage 1, shape (levels, m), and an acceleration that acts
    at every stage.

    Parameters
    ----------
    parameters
        Sizes, dynamics and weights.
    max_iterations
        Interior-point steps after which the best point is returned unsolved.
    """

    def __init__(self, parameters: ChainParameters, max_iterations: int) -> None:
        super().__init__(Chain(parameters), max_iterations)

    def set_matrices(self, turn: Array, transition: Array, terminal_cost: Array) -> None:
        """Replace E, F and the terminal cost (`Chain.set_matrices`)."""
        self._forget_factors()
        self.chain.set_matrices(turn, transition, terminal_cost)

    def set_clearances(self, directions: Array) -> None:
        """Replace the rows that keep clear of others (`Chain.set_clearances`)."""
        self._forget_factors()
        self.chain.set_clearances(directions)
