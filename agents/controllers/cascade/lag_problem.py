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
    chain_reference,
    solve_chain,
    to_body,
)
from rcopterx.agents.controllers.chains.active_set import ChainSolution
from rcopterx.agents.controllers.chains.chain import ChainParameters
from rcopterx.agents.controllers.chains.chain_qp import ChainQP
from rcopterx.agents.interfaces import Estimate
from rcopterx.agents.references.trajectory import Trajectory
from rcopterx.vehicles.state import Array, heading_matrices

HEADING_TOLERANCE_RAD: Final = 2e-5
TURN_TOLERANCE_RAD: Final = 4e-6
"""A heading plan that differs less (turn: per period) leaves the matrices as they are: the error stays below
a tenth of a millimetre after two seconds at full speed."""

_AXES: Final = slice(0, 2)


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
        samples, stages = reference.samples, self._parameters.stages
        middle = 0.5 * (heading[1:] + heading[:-1])
        if len(middle) == stages:
            middle = np.append(middle, middle[-1])
        c, s = np.cos(middle[: stages + 1]), np.sin(middle[: stages + 1])
        inertial = samples[:, 4:6]
        velocity = to_body(c[:-1], s[:-1], inertial)
        turn = heading[1 : stages + 1] - heading[:stages]
        carried = self._decay * velocity
        carried[:, 0] += turn * velocity[:, 1]
        carried[:, 1] -= turn * velocity[:, 0]
        after = carried
        if self._feed_forward:
            after = to_body(c[1:], s[1:], inertial + self._parameters.period_s * samples[:, 8:10])
        return chain_reference(self._parameters, samples[:, :2], velocity, after, carried)

    def _linearize(self, heading: Array) -> None:
        """Matrices of the chain along the planned heading."""
        known = self._heading_plan
        if known is not None:
            moved = heading - known
            turned = moved[1:] - moved[:-1]
            if np.abs(moved).max() < HEADING_TOLERANCE_RAD and np.abs(turned).max() < TURN_TOLERANCE_RAD:
                return
        middle = 0.5 * (heading[1:] + heading[:-1])
        transition = np.empty((len(middle) - 1, 2, 2))
        transition[:, 0, 0], transition[:, 1, 1] = self._decay
        transition[:, 0, 1] = heading[1:-1] - heading[:-2]
        transition[:, 1, 0] = -transition[:, 0, 1]
        last = float(middle[self._parameters.stages - 1])
        self._matrices = heading_matrices(middle), transition, self._heading_cost.at(last)
        self._free.set_matrices(*self._matrices)
        self._heading_plan = heading


def _first_state(estimate: Estimate) -> Array:
    """Position, velocity and actuator of the horizontal axes, shape (3, 2)."""
    return np.stack((estimate.motion[:4][_AXES], estimate.motion[4:][_AXES], estimate.actuator[_AXES]))
