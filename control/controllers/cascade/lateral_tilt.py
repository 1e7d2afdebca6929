"""The horizontal problem of a vehicle with a tilt model: stabilizer bar, rotor, servo and wind as states.

In the inertial frame the prediction (`rcopterx.control.models.lateral`) and the cost are the same at every
stage and every heading, so that the factor of the solver stays as long as no bound is active. The planned
heading turns only the rows that are bounded in the body frame, velocities and sticks, and the cost where the
weights of both axes differ.
"""

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.controllers.cascade.clearance import ClearRows
from rcopterx.control.controllers.cascade.lateral import HorizontalTask, turned, turns
from rcopterx.control.controllers.cascade.limits import PlanLimits, recovery
from rcopterx.control.controllers.cascade.weights import HORIZONTAL, CascadeWeights
from rcopterx.control.interfaces import TiltEstimate
from rcopterx.control.models.lateral import POSITION, VELOCITY, lateral_system
from rcopterx.control.solver.problem import HARD, OptimalControlProblem, Plan
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2, YAW, Array, heading_matrix

DEMAND = slice(4, 6)
BODY_VELOCITY = slice(6, 8)
STICK = slice(8, 10)
"""Rows: position and velocity, then these; the first six have weights, positions and the last four bounds."""


class LateralTilt:
    """Formulation with a tilt model for N = `stages` planned inputs.

    With `feed_forward` demands are referred to those that fly the reference, with `compensate` the prediction
    contains the estimated wind. Where weights of the body's axes differ, so that the cost turns with the
    heading, `same_cost` is False.
    """

    def __init__(
        self,
        model: Model,
        period_s: float,
        weights: CascadeWeights,
        stages: int,
        feed_forward: bool,
        compensate: bool,
    ) -> None:
        self._model, self._stages = model, stages
        self._feed_forward, self._compensate = feed_forward, compensate
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
        self._P: Array = np.ascontiguousarray(solve_discrete_are(A, B, Q, demand * np.eye(2)))
        self._A, self._B = np.tile(A, (stages, 1, 1)), np.tile(B, (stages, 1, 1))
        self._W = np.tile(W, (stages, 1))
        C, D = np.zeros((10, system.size)), np.zeros((10, 2))
        C[POSITION, POSITION] = C[VELOCITY, VELOCITY] = D[DEMAND] = np.eye(2)
        self._C, self._D = np.tile(C, (stages, 1, 1)), np.tile(D, (stages, 1, 1))
        self._s = np.zeros((stages, 10))
        self._s[1:, POSITION] = self._s[1:, BODY_VELOCITY] = weights.soft
        self._s[:, STICK] = HARD
        self._recovery = recovery(period_s, stages)

    def problem(
        self, task: HorizontalTask, limits: PlanLimits, clear: ClearRows | None
    ) -> OptimalControlProblem:
        """State the problem; sticks among its rows have the estimated trim added."""
        N, motion, reference = self._stages, task.estimate.motion, task.reference
        tilt = self._tilt_of(task)
        R, R_mid = turns(task.heading[:N]), turns(0.5 * (task.heading[:N] + task.heading[1 : N + 1]))
        C, D = self._C.copy(), self._D.copy()
        C[:, BODY_VELOCITY, VELOCITY] = R.swapaxes(1, 2)
        D[:, STICK] = R_mid.swapaxes(1, 2) / self._gain[:, None]
        low, high = np.full((N, 10), -np.inf), np.full((N, 10), np.inf)
        low[:, POSITION], high[:, POSITION] = limits.position[:, HORIZONTAL]
        low[:, BODY_VELOCITY], high[:, BODY_VELOCITY] = limits.velocities(
            HORIZONTAL, motion[4:6], self._recovery
        )
        low[:, STICK], high[:, STICK] = limits.sticks(HORIZONTAL, tilt.trim) + tilt.trim
        r = np.zeros((N, 10))
        r[:, POSITION], r[:, VELOCITY] = reference[:-1, :2], reference[:-1, 4:6]
        if self._feed_forward:
            sticks = np.clip(
                turned(R_mid, self._demands(reference)) / self._gain, low[:, STICK], high[:, STICK]
            )
            r[:, DEMAND] = np.einsum("kij,kj->ki", R_mid, sticks * self._gain)
        x_0, x_end = np.zeros((2, self._system.size))
        turn = heading_matrix(motion[YAW])
        x_0[POSITION], x_0[VELOCITY] = motion[:2], turn @ motion[4:6]
        x_0[self._system.core] = tilt.core
        x_0[self._system.servo] = turn @ (self._gain * tilt.servo)
        x_0[self._system.wind] = tilt.wind_m_s2
        x_end[POSITION], x_end[VELOCITY] = reference[-1, :2], reference[-1, 4:6]
        c = np.zeros((N, self._system.size))
        problem = OptimalControlProblem(
            self._A, self._B, c, C, D, self._W, r, low, high, self._s, self._P, x_end, x_0
        )
        return problem if clear is None else clear.added_to(problem)

    def _demands(self, reference: Array) -> Array:
        """Demands that fly the reference, inertial frame, shape (N, 2)."""
        needed = reference[:, 8:10] - self._drag * reference[:, 4:6]
        stages = np.arange(self._stages + 1.0)
        ahead = stages[:-1] + self._lead
        return np.column_stack([np.interp(ahead, stages, needed[:, axis]) for axis in range(2)])

    def _tilt_of(self, task: HorizontalTask) -> TiltEstimate:
        """Tilt to predict with; from actuator and disturbance where the estimator does not estimate it."""
        estimate = task.estimate
        if estimate.has_tilt:
            wind = estimate.tilt.wind_m_s2 if self._compensate else np.zeros(2)
            return TiltEstimate(estimate.tilt.core, estimate.tilt.servo, wind, estimate.tilt.trim)
        turn, servo = heading_matrix(estimate.motion[YAW]), estimate.actuator[:2]
        core = np.zeros(self._system.core.stop - self._system.core.start)
        core[:2] = turn @ (self._gain * servo) / GRAVITY_M_S2
        return TiltEstimate(core, servo, turn @ task.disturbance[:2], np.zeros(2))

    def velocity_at_end(self, plan: Plan, task: HorizontalTask) -> Array:  # noqa: ARG002 - it is a state
        """Return the velocity after the last stage, inertial frame, shape (2,)."""
        return plan.x[-1, VELOCITY]

    def sticks(self, plan: Plan, task: HorizontalTask) -> Array:
        """Return the pitch and roll sticks of a plan, shape (N, 2)."""
        return plan.y[:, STICK] - self._tilt_of(task).trim
