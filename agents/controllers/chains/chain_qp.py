"""Quadratic program of a chain (see `chain`): vehicles with lags, the vertical, yaw."""

from rcopterx.agents.controllers.chains.active_set import UNLIMITED, ActiveSetQP, Budget, ChainSolution
from rcopterx.agents.controllers.chains.chain import Chain, ChainParameters, ChainTarget
from rcopterx.vehicles.state import Array


class ChainQP(ActiveSetQP):
    """Workspace of one chain.

    Parameters
    ----------
    parameters
        Sizes, dynamics and weights.
    max_iterations
        Interior-point steps after which the best point is returned unsolved.
    """

    def __init__(self, parameters: ChainParameters, max_iterations: int) -> None:
        self._flat_chain = Chain(parameters)
        super().__init__(self._flat_chain, max_iterations)

    def set_matrices(self, turn: Array, transition: Array, terminal_cost: Array) -> None:
        """Replace E, F and the terminal cost (`Chain.set_matrices`)."""
        self._flat_chain.set_matrices(turn, transition, terminal_cost)
        self._factor = None

    def set_clearances(self, directions: Array) -> None:
        """Replace the rows that keep clear of others (`Chain.set_clearances`)."""
        self._flat_chain.set_clearances(directions)
        self._weigh_bounds()
        self._factor = None

    def balance(self, disturbance: Array) -> Array:
        """What a disturbance adds to the inputs, as an input, shape (m,)."""
        balance: Array = disturbance / self._flat_chain.parameters.gain
        return balance

    def solve(
        self, first_state: Array, disturbance: Array, target: ChainTarget, budget: Budget = UNLIMITED
    ) -> ChainSolution:
        """Solve with new numbers, starting from the last solution shifted by one stage.

        Parameters
        ----------
        first_state
            Position, velocity[, actuator] of stage 1, shape (levels, m).
        disturbance
            Acceleration that acts at every stage, shape (m,).
        target
            Reference and bounds.
        budget
            What it may take.

        Returns
        -------
        ChainSolution
            The minimiser, or the best point known: at most as costly as the planned inputs of the budget.
        """
        self._flat_chain.begin(first_state, disturbance, self._warm)
        return self._solve(self.balance(disturbance), target, budget)
