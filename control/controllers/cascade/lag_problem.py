"""The cascade's horizontal problem for vehicles with lags: exact along a planned heading"""

from dataclasses import replace
from typing import Final

import numpy as np

from rcopterx.control.controllers.cascade.clearance import SLOTS
from rcopterx.control.controllers.cascade.terms import (
    Bounds,
    HeadingCost,
    HorizontalTask,
)
from rcopterx.control.controllers.chains.active_set import ChainSolution
from rcopterx.control.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.control.controllers.chains.chain_qp import ChainQP
from rcopterx.native.cascade import heading_moved, horizontal_problem, turning
from rcopterx.vehicles.state import Array

HEADING_TOLERANCE_RAD: Final = 2e-5
TURN_TOLERANCE_RAD: Final = 4e-6
"""A heading plan that differs less (turn: per period) leaves the matrices as they are: the error stays below
a tenth of a millimetre after two seconds at full speed."""


class LagProblem:
    """Horizontal problem with one lag per stick.

    Parameters
    ----------
    parameters
        Dynamics, sizes and weights of the horizontal axes.
    decay
        One plus T_s times the damping, shape (2,).
    workspace
        Solver of the quadratic program.
    separation_weight
        Weight of the squared excess over a separation constraint.
    max_iterations
        Interior-point steps before the best point is taken.
    feed_forward
        Inputs are weighed against those that fly the reference instead of against hovering.
    """

    def __init__(
        self,
        parameters: ChainParameters,
        decay: Array,
        workspace: type[ChainQP],
        separation_weight: float,
        max_iterations: int,
        feed_forward: bool,
    ) -> None:
        self._parameters, self._decay, self._feed_forward = parameters, decay, feed_forward
        self._free = workspace(parameters, max_iterations)
        # Only periods in which somebody comes near pay for the rows that keep clear.
        crowded = replace(parameters, clearances=SLOTS, clearance_weight=separation_weight)
        self._crowded = ChainQP(crowded, max_iterations)
        self._last = self._free
        """The one that solved last; the other one has nothing to begin from."""
        self._heading_cost = HeadingCost(parameters, decay)
        self._dynamics = parameters.dynamics
        self._target = ChainTarget.empty(parameters.stages, 6, 2 * parameters.levels)
        self._first: Array = np.empty((parameters.levels, 2))
        self._heading_plan: Array | None = None

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._free.forget()
        self._crowded.forget()
        self._heading_plan = None

    def solve(self, task: HorizontalTask, bounds: Bounds, share: Bounds) -> ChainSolution:
        """Solve for the sticks of the horizon (`HorizontalProblem` in `terms`)."""
        estimate, target, heading, load = task.estimate, self._target, task.steady[:, 1], task.disturbance[:2]
        self._linearize(heading)
        parameters = self._parameters
        horizontal_problem(
            estimate.motion,
            estimate.actuator,
            load,
            task.reference,
            heading,
            bounds,
            share,
            self._decay,
            parameters.period_s,
            self._feed_forward,
            *self._dynamics,
            parameters.gain,
            self._first,
            *target,
        )
        qp = self._free if task.clear is None else self._crowded
        if qp is not self._last:
            self._last.forget()
            self._last = qp
        if task.clear is not None:
            self._crowded.set_matrices(*self._matrices)
            self._crowded.set_clearances(task.clear.directions)
            target = task.clear.add_rows(task.steady[: parameters.stages, 0], target)
        return qp.solve(self._first, load, target, task.budget)

    def _linearize(self, heading: Array) -> None:
        """Matrices of the chain along the planned heading."""
        known = self._heading_plan
        if known is not None and not heading_moved(heading, known, HEADING_TOLERANCE_RAD, TURN_TOLERANCE_RAD):
            return
        periods, last = len(heading) - 1, self._parameters.stages - 1
        turn, transition = np.empty((periods, 2, 2)), np.empty((periods - 1, 2, 2))
        turning(heading, self._decay, turn, transition)
        cost = self._heading_cost.at(0.5 * float(heading[last] + heading[last + 1]))
        self._matrices = turn, transition, cost
        self._free.set_matrices(turn, transition, cost)
        self._heading_plan = heading
