"""What both horizontal problems have in common."""

from typing import Protocol

import numpy as np

from rcopterx.control.controllers.cascade.clearance import ClearRows
from rcopterx.control.controllers.cascade.task import Task
from rcopterx.control.solver.problem import OptimalControlProblem, Plan
from rcopterx.vehicles.state import Array


class HorizontalProblem(Protocol):
    """The formulation for one kind of vehicle."""

    @property
    def same_cost(self) -> bool:
        """Whether A, B, P and the rows with weights are the same in every step."""
        ...

    def along(self, heading: Array, task: Task, clear: ClearRows | None) -> OptimalControlProblem:
        """State the problem along a planned heading of the N + 1 stages and one more, shape (N + 2,).

        Its first two states are the position in the inertial frame. Its arrays may be used again for the next
        problem.
        """
        ...

    def velocity_at_end(self, plan: Plan, heading: Array) -> Array:
        """Return the velocity after the last stage, inertial frame, shape (2,)."""
        ...

    def sticks(self, plan: Plan, task: Task) -> Array:
        """Return the pitch and roll sticks of a plan, shape (N, 2)."""
        ...


def turns(heading: Array) -> Array:
    """Return R(psi), body to inertial frame, of headings; shape (k, 2, 2)."""
    R = np.empty((len(heading), 2, 2))
    R[:, 0, 0] = R[:, 1, 1] = np.cos(heading)
    R[:, 1, 0] = np.sin(heading)
    R[:, 0, 1] = -R[:, 1, 0]
    return R


def turned(R: Array, vectors: Array) -> Array:
    """Return R v of vectors, shape (k, 2)."""
    return np.asarray((R @ vectors[:, :, None])[:, :, 0])
