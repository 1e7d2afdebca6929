"""Quadratic program of the horizontal motion of a vehicle with a tilt model."""

from rcopterx.agents.controllers.chains.active_set import UNLIMITED, ActiveSetQP, Budget, ChainSolution
from rcopterx.agents.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.agents.controllers.chains.lateral_chain import LateralChain
from rcopterx.agents.flight.lateral import LateralSystem
from rcopterx.vehicles.state import Array


class LateralQP(ActiveSetQP):
    """Workspace of the horizontal problem.

    Parameters
    ----------
    parameters
        Sizes and weights.
    system
        The prediction over one control period.
    max_iterations
        Interior-point steps after which the best point is returned unsolved.
    """

    def __init__(self, parameters: ChainParameters, system: LateralSystem, max_iterations: int) -> None:
        self.chain = LateralChain(parameters, system)
        super().__init__(self.chain, max_iterations)

    def set_headings(self, turn: Array, demand_turn: Array) -> None:
        """Replace the headings of the horizon (`LateralChain.set_headings`)."""
        self.chain.set_headings(turn, demand_turn)
        if self._factor_side is not None:
            self._factor = None

    def set_clearances(self, directions: Array) -> None:
        """Replace the rows that keep clear of others (`LateralChain.set_clearances`)."""
        self.chain.set_clearances(directions)
        self._weigh_bounds()
        self._factor = None

    def solve(
        self, first_state: Array, trim: Array, target: ChainTarget, budget: Budget = UNLIMITED
    ) -> ChainSolution:
        """Solve with new numbers, starting from the last solution shifted by one stage.

        Parameters
        ----------
        first_state
            State of the lateral system at stage 1, shape (n,).
        trim
            Offsets of the sticks, shape (2,).
        target
            Reference and bounds; inputs with the trim added.
        budget
            What it may take.

        Returns
        -------
        ChainSolution
            The minimiser, or the best point known: at most as costly as the planned inputs of the budget.
        """
        self.chain.begin(first_state, self._warm)
        return self._solve(trim, target, budget)
