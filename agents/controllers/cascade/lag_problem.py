"""The cascade's horizontal problem for vehicles with lags: exact along a planned heading (control.md section
6)."""

from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from rcopterx.agents.controllers.cascade.clearance import SLOTS
from rcopterx.agents.controllers.cascade.terms import (
    Bounds,
    HeadingCost,
    HorizontalTask,
    solve_chain,
)
from rcopterx.agents.controllers.chains.active_set import ChainSolution
from rcopterx.agents.controllers.chains.chain import ChainParameters
from rcopterx.agents.controllers.chains.chain_qp import ChainQP
from rcopterx.agents.interfaces import Estimate
from rcopterx.agents.references.trajectory import Trajectory
from rcopterx.native.cascade import heading_moved, horizontal_rows, turning
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
        self._dynamics = parameters.dynamics
        self._free = workspace(parameters, max_iterations)
        # Only periods in which somebody comes near pay for the rows that keep clear.
        crowded = replace(parameters, clearances=SLOTS, clearance_weight=separation_weight)
        self._crowded = ChainQP(crowded, max_iterations)
        self._heading_cost = HeadingCost(parameters, decay)
        self._heading_plan: Array | None = None

    def forget(self) -> None:
        """Start the next solve from nothing."""
        self._free.forget()
        self._crowded.forget()
        self._heading_plan = None

    def solve(self, task: HorizontalTask, bounds: Bounds, share: Bounds) -> ChainSolution:
        """Solve for the sticks of the horizon (`HorizontalProblem` in `terms`)."""
        self._linearize(task.heading)
        rows, terminal = self._reference(task.heading, task.reference)
        first = _first_state(task.estimate)
        push = task.push
        if task.clear is None:
            self._crowded.forget()
            return solve_chain(self._free, first, push, (rows, terminal), bounds, share, task.budget)
        self._free.forget()
        self._crowded.set_matrices(*self._matrices)
        self._crowded.set_clearances(task.clear.directions)
        add = partial(task.clear.add_rows, task.height_m)
        return solve_chain(self._crowded, first, push, (rows, terminal), bounds, share, task.budget, add)

    def _reference(self, heading: Array, reference: Trajectory) -> tuple[Array, Array]:
        """Velocities and accelerations in the body frame of the planned heading."""
        rows, terminal = self._parameters.empty_reference()
        horizontal_rows(
            reference.samples,
            heading,
            self._decay,
            self._parameters.period_s,
            self._feed_forward,
            *self._dynamics,
            rows,
            terminal,
        )
        return rows, terminal

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


def _first_state(estimate: Estimate) -> Array:
    """Position, velocity and actuator of the horizontal axes, shape (3, 2)."""
    first = np.empty((3, 2))
    first[0], first[1], first[2] = estimate.motion[:2], estimate.motion[4:6], estimate.actuator[:2]
    return first
