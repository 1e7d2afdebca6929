"""What both horizontal problems have in common."""

from typing import Protocol

import numpy as np
from msgspec import Struct

from rcopterx.control.controllers.cascade.clearance import ClearRows
from rcopterx.control.controllers.cascade.limits import PlanLimits
from rcopterx.control.interfaces import Estimate
from rcopterx.control.solver.problem import OptimalControlProblem, Plan
from rcopterx.vehicles.state import Array


class HorizontalTask(Struct, frozen=True):
    """What the horizontal problem of a control step depends on."""

    estimate: Estimate
    disturbance: Array
    """Accelerations to predict with, in the order of `Estimate.disturbance`, shape (4,)."""
    heading: Array
    """Planned heading of the N + 1 stages and one more, shape (N + 2,)."""
    reference: Array
    """Samples, shape (N + 1, 12)."""


class HorizontalProblem(Protocol):
    """The formulation for one kind of vehicle."""

    @property
    def same_cost(self) -> bool:
        """Whether A, B, P and the rows with weights are the same in every step."""
        ...

    def problem(
        self, task: HorizontalTask, limits: PlanLimits, clear: ClearRows | None
    ) -> OptimalControlProblem:
        """State the problem; its first two states are the position in the inertial frame."""
        ...

    def velocity_at_end(self, plan: Plan, task: HorizontalTask) -> Array:
        """Return the velocity after the last stage, inertial frame, shape (2,)."""
        ...

    def sticks(self, plan: Plan, task: HorizontalTask) -> Array:
        """Return the pitch and roll sticks of a plan, shape (N, 2)."""
        ...


def turns(heading: Array) -> Array:
    """Return R(psi), body to inertial frame, of headings; shape (k, 2, 2)."""
    R = np.empty((len(heading), 2, 2))
    R[:, 0, 0] = R[:, 1, 1] = np.cos(heading)
    R[:, 1, 0] = np.sin(heading)
    R[:, 0, 1] = -R[:, 1, 0]
    return R


def turned(R: Array, inertial: Array) -> Array:
    """Return vectors of the inertial frame in the body frame, shape (k, 2)."""
    return np.asarray(np.einsum("kji,kj->ki", R, inertial))
