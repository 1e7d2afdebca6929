"""The horizontal problem of a vehicle whose sticks act through lags (docs/formulas.md).

Along a planned heading psi_k the motion is exactly linear, time-varying: positions in the inertial frame,
velocities and actuators in the body frame, which turns by psi_{k+1} - psi_k in a period.

    p+ = p + T R(psi_mid) v,    v+ = F_k v + T (b a + disturbance)
    F_k = [[1 + T k_x, turn], [-turn, 1 + T k_y]]
"""

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.controllers.cascade.clearance import ClearRows
from rcopterx.control.controllers.cascade.lags import LagDynamics
from rcopterx.control.controllers.cascade.lateral import HorizontalTask, turned, turns
from rcopterx.control.controllers.cascade.limits import PlanLimits, recovery
from rcopterx.control.controllers.cascade.weights import HORIZONTAL, CascadeWeights
from rcopterx.control.solver.problem import HARD, OptimalControlProblem, Plan
from rcopterx.vehicles.state import Array, heading_matrix


class LateralLags:
    """Formulation with one lag per stick; parameters as of `AxisProblem`."""

    same_cost = False
    """A changes with every heading plan."""

    def __init__(
        self, dynamics: LagDynamics, weights: CascadeWeights, stages: int, feed_forward: bool
    ) -> None:
        self._dynamics, self._stages, self._feed_forward = dynamics, stages, feed_forward
        A, B = dynamics.matrices()
        n = dynamics.states
        C, D = np.zeros((6, n)), np.zeros((6, 2))
        C[:4, :4], D[4:] = np.eye(4), np.eye(2)
        W = np.concatenate(
            (weights.position[HORIZONTAL], weights.velocity[HORIZONTAL], weights.effort[HORIZONTAL])
        )
        Q = C.T @ np.diag((*W[:4], 0.0, 0.0)) @ C
        self._P_0: Array = np.asarray(solve_discrete_are(A, B, Q, np.diag(W[4:])), dtype=float)
        self._A, self._B = np.tile(A, (stages, 1, 1)), np.tile(B, (stages, 1, 1))
        self._C, self._D, self._W = (
            np.tile(C, (stages, 1, 1)),
            np.tile(D, (stages, 1, 1)),
            np.tile(W, (stages, 1)),
        )
        self._s = np.tile((*4 * [weights.soft], HARD, HARD), (stages, 1))
        self._s[0, :4] = 0.0
        self._recovery = recovery(dynamics.period_s, stages)

    def problem(
        self, task: HorizontalTask, limits: PlanLimits, clear: ClearRows | None
    ) -> OptimalControlProblem:
        """State the problem along a planned heading."""
        dynamics, N, T = self._dynamics, self._stages, self._dynamics.period_s
        estimate, reference, heading = task.estimate, task.reference, task.heading
        middle = turns(0.5 * (heading[:-1] + heading[1:]))
        turn = np.diff(heading)[:, None]
        A = self._A.copy()
        A[:, :2, 2:4] = T * middle[:N]
        A[:, 2, 3], A[:, 3, 2] = turn[:N, 0], -turn[:N, 0]
        load = task.disturbance[:2]
        balance = load / dynamics.gain
        velocity = turned(middle[: N + 1], reference[:, 4:6])
        actuators, sticks = self._feed_forward_of(reference, velocity, middle, turn)
        low, high = np.empty((N, 6)), np.empty((N, 6))
        low[:, :2], high[:, :2] = limits.position[:, HORIZONTAL]
        measured = estimate.motion[4:6]
        low[:, 2:4], high[:, 2:4] = limits.velocities(HORIZONTAL, measured, self._recovery)
        low[:, 4:], high[:, 4:] = limits.sticks(HORIZONTAL, balance)
        aimed = np.clip(sticks - balance, low[:, 4:], high[:, 4:])
        r = np.column_stack((reference[:-1, :2], velocity[:-1], aimed))
        c = np.zeros((N, dynamics.states))
        c[:, 2:4] = T * load
        x_0 = np.concatenate((estimate.motion[:2], measured, estimate.actuator[:2]))[: dynamics.states]
        x_end = np.concatenate((reference[-1, :2], velocity[-1], actuators[-1] - balance))[: dynamics.states]
        R = middle[N]
        P = self._P_0.copy()
        P[:2] = R @ P[:2]
        P[:, :2] = P[:, :2] @ R.T
        problem = OptimalControlProblem(
            A, self._B, c, self._C, self._D, self._W, r, low, high, self._s, P, x_end, x_0
        )
        return problem if clear is None else clear.added_to(problem)

    def _feed_forward_of(
        self, reference: Array, velocity: Array, middle: Array, turn: Array
    ) -> tuple[Array, Array]:
        """Actuators, shape (N + 1, 2), and sticks, shape (N, 2), that fly the reference."""
        dynamics, N = self._dynamics, self._stages
        change = np.zeros((N + 1, 2))
        if self._feed_forward:
            following = np.concatenate((middle[1 : N + 1], middle[-1:]))
            after = turned(following, reference[:, 4:6] + dynamics.period_s * reference[:, 8:10])
            carried = dynamics.decay * velocity + turn[: N + 1] * (velocity[:, ::-1] * (1.0, -1.0))
            change = after - carried
        return dynamics.feed_forward(change, velocity)

    def velocity_at_end(self, plan: Plan, task: HorizontalTask) -> Array:
        """Return the velocity after the last stage, inertial frame, shape (2,)."""
        middle_rad = 0.5 * float(task.heading[-2] + task.heading[-1])
        return np.asarray(heading_matrix(middle_rad) @ plan.x[-1, 2:4])

    def sticks(self, plan: Plan, task: HorizontalTask) -> Array:  # noqa: ARG002 - the plan's inputs are sticks
        """Return the pitch and roll sticks of a plan, shape (N, 2)."""
        return plan.u
