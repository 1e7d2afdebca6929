"""The horizontal problem, of vehicles with lags and of those with a tilt model (docs/formulas.md).

With lags, along a planned heading psi_k, the motion is exactly linear, time-varying: positions in the
inertial frame, velocities and actuators in the body frame, which turns by psi_{k+1} - psi_k in a period.

    p+ = p + T R(psi_mid) v,    v+ = F_k v + T (b a + disturbance)
    F_k = [[1 + T k_x, turn], [-turn, 1 + T k_y]]

With a tilt model, stabilizer bar, rotor, servo and wind are states. In the inertial frame the prediction
(`rcopterx.control.models.lateral`) and the cost are the same at every stage and every heading, so that the
factor of the solver stays as long as no bound is active. The planned heading turns only the rows that are
bounded in the body frame, velocities and sticks, and the cost where the weights of both axes differ.
"""

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.controllers.cascade.axis import AxisProblem
from rcopterx.control.controllers.cascade.clearance import ClearRows
from rcopterx.control.controllers.cascade.limits import Task
from rcopterx.control.controllers.cascade.weights import HORIZONTAL, CascadeWeights
from rcopterx.control.interfaces import Estimate, TiltEstimate
from rcopterx.control.models.lateral import POSITION, VELOCITY, lateral_system
from rcopterx.control.solver.problem import HARD, OptimalControlProblem, Plan, repeated
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2, YAW, Array, heading_matrix


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


class LateralLags(AxisProblem):
    """Formulation for the axes x and y, with one lag per stick."""

    same_cost = False
    """A changes with every heading plan."""

    def along(self, heading: Array, task: Task, clear: ClearRows | None) -> OptimalControlProblem:
        """State the problem along a planned heading of the N + 1 stages and one more, shape (N + 2,).

        Its first two states are the position in the inertial frame.
        """
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


DEMAND = slice(4, 6)
BODY_VELOCITY = slice(6, 8)
STICK = slice(8, 10)
"""Rows: position and velocity, then these; the first six have weights, positions and the last four bounds."""


class LateralTilt:
    """Formulation with a tilt model for N = `stages` planned inputs.

    With `feed_forward` demands are referred to those that fly the reference. Where weights of the body's axes
    differ, so that the cost turns with the heading, `same_cost` is False. The arrays of a problem are used
    again for the next one.
    """

    def __init__(
        self, model: Model, period_s: float, weights: CascadeWeights, stages: int, feed_forward: bool
    ) -> None:
        self._feed_forward = feed_forward
        self._system = system = lateral_system(model, period_s)
        self._gain = model.b[HORIZONTAL]
        self._drag = float(model.k[HORIZONTAL].mean())
        tilt = model.tilt
        assert tilt is not None
        self._lead = (tilt.servo_lag_s + 2.0 * tilt.damping_ratio / tilt.frequency_rad_s) / period_s
        """Stages by which demands precede the accelerations that they cause."""
        A, B = system.transition, system.demand
        W = np.zeros(10)
        W[POSITION], W[VELOCITY] = weights.position[HORIZONTAL], weights.velocity[HORIZONTAL]
        W[DEMAND] = weights.effort[HORIZONTAL] / self._gain**2
        self.same_cost = bool(np.allclose(W[2:6:2], W[3:6:2], rtol=1e-6))
        # The terminal cost prefers no direction: it takes the means of x and y.
        position, velocity, demand = W[:6].reshape(3, 2).mean(axis=1)
        Q = np.diag(np.repeat((position, velocity, *np.zeros(system.size // 2 - 2)), 2))
        P = solve_discrete_are(A, B, Q, demand * np.eye(2))
        C, D, s = np.zeros((10, system.size)), np.zeros((10, 2)), np.zeros(10)
        C[POSITION, POSITION] = C[VELOCITY, VELOCITY] = D[DEMAND] = np.eye(2)
        s[POSITION] = s[BODY_VELOCITY] = weights.soft
        s[STICK] = HARD
        self._problem = repeated(stages, A, B, C, D, W, s, P)
        self._problem.s[0, : STICK.start] = 0.0

    def along(self, heading: Array, task: Task, clear: ClearRows | None) -> OptimalControlProblem:
        """State the problem as `LateralLags.along` does; sticks among its rows have the trim added."""
        p, system, bounds = self._problem, self._system, task.bounds
        motion, tilt, reference = task.estimate.motion, task.estimate.tilt, task.reference
        R, R_mid = turns(heading[:-2]), turns(0.5 * (heading[:-2] + heading[1:-1]))
        to_body = R_mid.swapaxes(1, 2)
        p.C[:, BODY_VELOCITY, VELOCITY] = R.swapaxes(1, 2)
        p.D[:, STICK] = to_body / self._gain[:, None]
        low, high = bounds.stick[:, HORIZONTAL] + tilt.trim
        p.low[:, POSITION], p.high[:, POSITION] = bounds.position[:, HORIZONTAL]
        p.low[:, BODY_VELOCITY] = bounds.lowest_velocity[:, HORIZONTAL]
        p.high[:, BODY_VELOCITY] = bounds.highest_velocity[:, HORIZONTAL]
        p.low[:, STICK], p.high[:, STICK] = low, high
        p.r[:, POSITION], p.r[:, VELOCITY] = reference[:-1, :2], reference[:-1, 4:6]
        if self._feed_forward:
            sticks = turned(to_body, self._demands(reference)) / self._gain
            p.r[:, DEMAND] = turned(R_mid, np.minimum(np.maximum(sticks, low), high) * self._gain)
        turn = heading_matrix(motion[YAW])
        p.x_0[POSITION], p.x_0[VELOCITY] = motion[:2], turn @ motion[4:6]
        p.x_0[system.core], p.x_0[system.servo] = tilt.core, turn @ (self._gain * tilt.servo)
        p.x_0[system.wind] = tilt.wind_m_s2
        p.x_end[POSITION], p.x_end[VELOCITY] = reference[-1, :2], reference[-1, 4:6]
        return p if clear is None else clear.added_to(p)

    def _demands(self, reference: Array) -> Array:
        """Demands that fly the reference, inertial frame, shape (N, 2)."""
        needed = reference[:, 8:10] - self._drag * reference[:, 4:6]
        stages = np.arange(len(reference) + 0.0)
        ahead = stages[:-1] + self._lead
        return np.column_stack([np.interp(ahead, stages, needed[:, axis]) for axis in range(2)])

    def velocity_at_end(self, plan: Plan, heading: Array) -> Array:  # noqa: ARG002 - it is a state
        """Return the velocity after the last stage, inertial frame, shape (2,)."""
        return plan.x[-1, VELOCITY]

    def sticks(self, plan: Plan, task: Task) -> Array:
        """Return the pitch and roll sticks of a plan, shape (N, 2)."""
        return plan.y[:, STICK] - task.estimate.tilt.trim


def with_tilt(model: Model, estimate: Estimate, disturbance: Array, compensate: bool) -> Estimate:
    """Return an estimate whose tilt the prediction starts from.

    Where the estimator estimates no tilt, it follows from actuator and disturbance, shape (4,). The wind is
    zero where the prediction does not `compensate` for it.
    """
    if estimate.has_tilt:
        wind = estimate.tilt.wind_m_s2 if compensate else np.zeros(2)
        return estimate._replace(tilt=estimate.tilt._replace(wind_m_s2=wind))
    turn, servo = heading_matrix(estimate.motion[YAW]), estimate.actuator[:2]
    assert model.tilt is not None
    core = np.zeros(model.tilt.dynamics().size)
    core[:2] = turn @ (model.b[HORIZONTAL] * servo) / GRAVITY_M_S2
    return estimate._replace(tilt=TiltEstimate(core, servo, turn @ disturbance[:2], np.zeros(2)))
