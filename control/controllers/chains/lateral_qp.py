"""Quadratic program of the horizontal motion of a vehicle with a tilt model."""

from rcopterx.control.controllers.chains.active_set import ActiveSetQP
from rcopterx.control.controllers.chains.chain import ChainParameters
from rcopterx.control.controllers.chains.lateral_chain import LateralChain
from rcopterx.control.models.lateral import LateralSystem
from rcopterx.vehicles.state import Array


class LateralQP(ActiveSetQP[LateralChain]):
    """Workspace of the horizontal problem.

    It solves from a state of the lateral system, shape (n,), and the offsets of the sticks.

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
        super().__init__(LateralChain(parameters, system), max_iterations)

    def turned(self) -> None:
        """The headings of the chain are other ones, on which only factors with active bounds depend."""
        self._pressed.stale = True

    def set_clearances(self, directions: Array) -> None:
        """Replace the rows that keep clear of others (`LateralChain.set_clearances`)."""
        self._pressed.stale = True
        self.chain.set_clearances(directions)
