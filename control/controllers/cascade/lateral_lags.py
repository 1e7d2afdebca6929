"""The horizontal problem of a vehicle whose sticks act through lags (docs/formulas.md).

Along a planned heading psi_k the motion is exactly linear, time-varying: positions in the inertial frame,
velocities and actuators in the body frame, which turns by psi_{k+1} - psi_k in a period.

    p+ = p + T R(psi_mid) v,    v+ = F_k v + T (b a + disturbance)
    F_k = [[1 + T k_x, turn], [-turn, 1 + T k_y]]
"""

import numpy as np

from rcopterx.control.controllers.cascade.axis import AxisProblem
from rcopterx.control.controllers.cascade.clearance import ClearRows
from rcopterx.control.controllers.cascade.lateral import turned, turns
from rcopterx.control.controllers.cascade.task import Task
from rcopterx.control.solver.problem import OptimalControlProblem, Plan
from rcopterx.vehicles.state import Array, heading_matrix


class LateralLags(AxisProblem):
    """Formulation for the axes x and y, with one lag per stick."""

    same_cost = False
    """A changes with every heading plan."""

    def along(self, heading: Array, task: Task, clear: ClearRows | None) -> OptimalControlProblem:
        """State the problem (`rcopterx.control.controllers.cascade.lateral.HorizontalProblem`)."""
        dynamics, reference, p = self._dynamics, task.reference, self._problem
        N, T = len(p.A), dynamics.period_s
        middle = turns(0.5 * (heading[:-1] + heading[1:]))
        to_body = middle.swapaxes(1, 2)
        turn = np.diff(heading)[:, None]
        velocity = turned(to_body, reference[:, 4:6])
        change = np.zeros((N + 1, 2))
        if self._feed_forward:
            following = np.concatenate((to_body[1:], to_body[-1:]))
            after = turned(following, reference[:, 4:6] + T * reference[:, 8:10])
            change = after - dynamics.decay * velocity - turn * (velocity[:, ::-1] * (1.0, -1.0))
        p.A[:, :2, 2:4] = T * middle[:N]
        p.A[:, 2, 3], p.A[:, 3, 2] = turn[:N, 0], -turn[:N, 0]
        R = middle[N]
        p.P[:] = self._P_0
        p.P[:2] = R @ p.P[:2]
        p.P[:, :2] = p.P[:, :2] @ R.T
        self._stated(task, velocity, change)
        return p if clear is None else clear.added_to(p)

    def velocity_at_end(self, plan: Plan, heading: Array) -> Array:
        """Return the velocity after the last stage, inertial frame, shape (2,)."""
        middle_rad = 0.5 * float(heading[-2] + heading[-1])
        return np.asarray(heading_matrix(middle_rad) @ plan.x[-1, 2:4])

    def sticks(self, plan: Plan, task: Task) -> Array:  # noqa: ARG002 - the plan's inputs are sticks
        """Return the pitch and roll sticks of a plan, shape (N, 2)."""
        return plan.u
