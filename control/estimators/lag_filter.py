"""Extended Kalman filter on model (1) with first-order lags of the actuators (docs/formulas.md).

Sixteen states: eight of the motion, four actuators, four disturbance accelerations as random walks. The
estimated disturbance is what makes the predictive controllers free of offset.

The Jacobian of the prediction is analytic. In the body frame every axis is a linear chain: disturbance and
lagged input push the velocity, the velocity moves the position. A gyro feeds the yaw rate back, and a thrust
that turns the vehicle joins the chains of height and yaw. The chains depend on the period alone and are
discretised exactly once; per step only the heading, the turning of the body frame and the displacement enter.
Products of yaw rate and period beyond the first order are neglected (under 1 % at the yaw rates of indoor
helicopters).
"""

import math
from typing import Final

import numpy as np
from scipy.linalg import expm

from rcopterx.compiling.compiled import ANY_VECTOR, MATRIX, compiled
from rcopterx.control.estimators.base import body_motion, inertial_rates
from rcopterx.control.estimators.kalman_equations import predict_covariance, update
from rcopterx.control.estimators.settings import ExtendedKalmanSettings, noise_of
from rcopterx.control.interfaces import Estimate
from rcopterx.control.models.linear import cached_by_period
from rcopterx.control.models.prediction import predict
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import (
    INPUT_SIZE,
    MOTION_SIZE,
    U_THRUST,
    XD_BODY,
    YAW,
    YAW_RATE,
    YD_BODY,
    ZD_BODY,
    Array,
    X,
    Y,
    Z,
)

SIZE: Final = MOTION_SIZE + 2 * INPUT_SIZE  # motion, actuators, disturbances
MOTION: Final = slice(0, MOTION_SIZE)
ACTUATOR: Final = slice(MOTION_SIZE, MOTION_SIZE + INPUT_SIZE)
DISTURBANCE: Final = slice(MOTION_SIZE + INPUT_SIZE, SIZE)
_LIFT: Final = DISTURBANCE.start + U_THRUST


@cached_by_period
def jacobian_at_rest(model: Model, period_s: float) -> Array:
    """Return the Jacobian of a vehicle at rest that heads along x, shape (16, 16)."""
    position, velocity = np.array((X, Y, Z, YAW)), np.array((XD_BODY, YD_BODY, ZD_BODY, YAW_RATE))
    actuator, disturbance = np.arange(SIZE)[ACTUATOR], np.arange(SIZE)[DISTURBANCE]
    lag_s, instant = np.array(model.lag_s), np.array(model.lag_s) == 0.0
    gain = np.where(instant, 0.0, np.array(model.input_gain))
    rate = np.where(instant, 0.0, 1.0 / np.where(instant, 1.0, lag_s))
    continuous = np.zeros((SIZE, SIZE))
    continuous[position, velocity] = continuous[velocity, disturbance] = 1.0
    continuous[velocity, velocity] = model.direct_damping
    continuous[velocity, actuator] = gain
    continuous[actuator, velocity] = -rate * model.rate_feedback
    continuous[actuator, actuator] = -rate
    _, _, thrust, yaw = actuator
    continuous[yaw, thrust] = -rate[-1] * model.thrust_coupling
    jacobian: Array = expm(period_s * continuous)
    jacobian[actuator[instant], actuator[instant]] = 0.0
    return jacobian


@compiled(MATRIX, ANY_VECTOR, ANY_VECTOR)
def jacobian(at_rest: Array, start: Array, end: Array) -> Array:
    """Return the derivative of the state after a period by the state before it, shape (16, 16)."""
    F = at_rest.copy()
    c, s = math.cos(start[YAW]), math.sin(start[YAW])
    turn_c, turn_s = math.cos(end[YAW] - start[YAW]), math.sin(end[YAW] - start[YAW])
    for column in range(YAW + 1, SIZE):
        along, across = at_rest[X, column], at_rest[Y, column]
        F[X, column], F[Y, column] = c * along - s * across, s * along + c * across
        along, across, turning = at_rest[XD_BODY, column], at_rest[YD_BODY, column], at_rest[YAW, column]
        F[XD_BODY, column] = turn_c * along + turn_s * across + end[YD_BODY] * turning
        F[YD_BODY, column] = turn_c * across - turn_s * along - end[XD_BODY] * turning
    # Everything else turns with the vehicle, so a turned start turns the displacement.
    F[X, YAW], F[Y, YAW] = start[Y] - end[Y], end[X] - start[X]
    return F


_START_DEVIATION: Final = np.array(
    [0.001, 0.001, 0.001, 0.005, 0.3, 0.3, 0.3, 1.0, 0.03, 0.03, 0.03, 0.03, 0.3, 0.3, 0.8, 3.0]
)
POSE: Final = slice(0, INPUT_SIZE)  # position and yaw
_H: Final = np.eye(INPUT_SIZE, SIZE)


class LagFilter:
    """State x, shape (16,), and covariance P, shape (16, 16), of one vehicle."""

    def __init__(self, model: Model, settings: ExtendedKalmanSettings) -> None:
        noise = noise_of(model, settings)
        densities = [0.0] * 4, noise.velocity_noise, noise.actuator_noise, settings.disturbance_noise
        self._model = model
        self._densities = np.diag(np.square(np.concatenate(densities)))
        self._prepared = cached_by_period(self._prepare)
        self._limit = np.full(SIZE, np.inf)
        self._limit[DISTURBANCE] = noise.disturbance_limit
        self.x: Array = np.zeros(SIZE)
        self.x[ACTUATOR] = model.hover_input

    def _prepare(self, period_s: float) -> tuple[Array, Array]:
        """Return the Jacobian at rest, and the covariance Q that a period adds."""
        return jacobian_at_rest(self._model, period_s), period_s * self._densities

    @property
    def estimate(self) -> Estimate:
        """The estimated motion, actuators and disturbances."""
        x = self.x.copy()
        return Estimate(x[MOTION], x[ACTUATOR], x[DISTURBANCE])

    @property
    def disturbance_at_limit(self) -> bool:
        """Whether the upward disturbance has reached its limit."""
        return bool(self.x[_LIFT] >= self._limit[_LIFT])

    def start(self, pose: Array, rates: Array) -> None:
        """Start at a pose with inertial velocity and yaw rate, both of shape (4,); actuators stay."""
        self.x = np.concatenate((body_motion(pose, rates), self.x[ACTUATOR], np.zeros(INPUT_SIZE)))
        self.P = np.diag(np.square(_START_DEVIATION))

    def move(self, offset: Array) -> None:
        """Move position and yaw by an offset, shape (4,); the inertial velocity stays."""
        self.x[MOTION] = body_motion(self.x[POSE] + offset, inertial_rates(self.x[MOTION]))

    def set_disturbance(self, disturbance: Array) -> None:
        """Replace the disturbance, cut to its limits, shape (4,)."""
        limit = self._limit[DISTURBANCE]
        self.x[DISTURBANCE] = np.clip(disturbance, -limit, limit)

    def predict(self, applied_input: Array, period_s: float) -> None:
        """Predict by one period: x = f(x, u), P = F P F' + Q."""
        before, (at_rest, Q) = self.estimate, self._prepared(period_s)
        after = predict(self._model, before, applied_input, period_s)
        self.P = predict_covariance(self.P, jacobian(at_rest, before.motion, after.motion), Q)
        self.x = np.concatenate(after[:3])

    def correct(self, pose: Array, R: Array) -> None:
        """Correct by a pose (position and unwrapped yaw) with variances R, both of shape (4,)."""
        self.x, self.P = update(self.x, self.P, _H, R, pose, self._limit)
