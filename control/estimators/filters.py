"""The Kalman filters of the default estimator, in the usual symbols (docs/formulas.md).

`LagFilter` estimates all vehicles, `TiltFilter` the horizontal motion of those with a tilt model.
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.linalg import expm

from rcopterx.compiling.compiled import ANY_VECTOR, COUNT, MATRIX, NUMBER, VECTOR, compiled
from rcopterx.control.estimators.kalman import predict_covariance, update
from rcopterx.control.estimators.process_noise import process_noise
from rcopterx.control.estimators.settings import ExtendedKalmanSettings, noise_of
from rcopterx.control.interfaces import Estimate, TiltEstimate
from rcopterx.control.models.lateral import (
    CORE_FROM,
    LATERAL_STEP,
    POSITION,
    VELOCITY,
    LateralStep,
    lateral_system,
    predict_lateral,
)
from rcopterx.control.models.linear import PERIOD_DIGITS
from rcopterx.control.models.prediction import MOTION_MODEL, integrate_motion, steps_in
from rcopterx.vehicles.model import Model, MotionModel
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
    body_motion,
    heading_matrix,
    inertial_rates,
)

SIZE: Final = MOTION_SIZE + 2 * INPUT_SIZE  # motion, actuators, disturbances
MOTION: Final = slice(0, MOTION_SIZE)
ACTUATOR: Final = slice(MOTION_SIZE, MOTION_SIZE + INPUT_SIZE)
DISTURBANCE: Final = slice(MOTION_SIZE + INPUT_SIZE, SIZE)
_LIFT: Final = DISTURBANCE.start + U_THRUST


@lru_cache(maxsize=256)
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


@compiled(MOTION_MODEL, VECTOR, *3 * [MATRIX], ANY_VECTOR, NUMBER, COUNT)
def _predict_lags(
    model: MotionModel,
    x: Array,
    P: Array,
    at_rest: Array,
    Q: Array,
    applied_input: Array,
    step_s: float,
    steps: int,
) -> None:
    """Predict state and covariance of a `LagFilter`: x = f(x, u), P = F P F' + Q."""
    before = x[:MOTION_SIZE].copy()
    actuator, disturbance = x[MOTION_SIZE : MOTION_SIZE + INPUT_SIZE], x[MOTION_SIZE + INPUT_SIZE :]
    motion, actuator[:] = integrate_motion(model, before, actuator, applied_input, disturbance, step_s, steps)
    P[:] = predict_covariance(P, jacobian(at_rest, before, motion), Q)
    x[:MOTION_SIZE] = motion


_START_DEVIATION: Final = np.array(
    [0.001, 0.001, 0.001, 0.005, 0.3, 0.3, 0.3, 1.0, 0.03, 0.03, 0.03, 0.03, 0.3, 0.3, 0.8, 3.0]
)
POSE: Final = slice(0, INPUT_SIZE)  # position and yaw
_H: Final = np.eye(INPUT_SIZE, SIZE)


class LagFilter:
    """Filter on model (1) with first-order lags of the actuators: state x, shape (16,), and covariance P.

    Sixteen states: eight of the motion, four actuators, four disturbance accelerations as random walks. The
    estimated disturbance is what makes the predictive controllers free of offset.

    The Jacobian of the prediction is analytic. In the body frame every axis is a linear chain: disturbance
    and lagged input push the velocity, the velocity moves the position. A gyro feeds the yaw rate back, and a
    thrust that turns the vehicle joins the chains of height and yaw. The chains depend on the period alone
    and are discretised exactly once; per step only the heading, the turning of the body frame and the
    displacement enter. Products of yaw rate and period beyond the first order are neglected (under 1 % at the
    yaw rates of indoor helicopters).
    """

    def __init__(self, model: Model, settings: ExtendedKalmanSettings) -> None:
        noise = noise_of(model, settings)
        densities = [0.0] * 4, noise.velocity_noise, noise.actuator_noise, settings.disturbance_noise
        self._model = model
        self._densities = np.diag(np.square(np.concatenate(densities)))
        self._prepared = lru_cache(maxsize=256)(self._prepare)
        self._limit = np.full(SIZE, np.inf)
        self._limit[DISTURBANCE] = noise.disturbance_limit
        self.x: Array = np.zeros(SIZE)
        self.x[ACTUATOR] = model.hover_input

    def _prepare(self, period_s: float) -> tuple[Array, Array, int]:
        """Return the Jacobian at rest, the covariance Q that a period adds, and the number of its steps."""
        return jacobian_at_rest(self._model, period_s), period_s * self._densities, steps_in(period_s)

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
        """Predict by one period."""
        at_rest, Q, steps = self._prepared(round(period_s, PERIOD_DIGITS))
        model = self._model.motion_model
        _predict_lags(model, self.x, self.P, at_rest, Q, applied_input, period_s / steps, steps)

    def correct(self, pose: Array, R: Array) -> None:
        """Correct by a pose (position and unwrapped yaw) with variances R, both of shape (4,)."""
        update(self.x, self.P, _H, R, pose, self._limit)


TRIM_LIMIT: Final = 0.3
OFFSET_LIMIT_RAD: Final = 0.2
WIND_LIMIT_M_S2: Final = 1.5
LEVER_LIMIT_M: Final = 0.2
TILT_GATE: Final = 0.3  # a measured tilt further from the predicted one is rejected, as of mixed-up markers
LEVEL_FLOOR_RAD: Final = 0.02  # of floor and gear from level: standing shows the offset of the body frame

_ANY_PERIOD_S: Final = 0.02  # the layout of the states does not depend on the period
_START_POSITION_M: Final = 0.001
_START_VELOCITY_M_S: Final = 0.3
_START_TILT: Final = 0.03
_START_RATE: Final = 0.3
_START_SERVO: Final = 0.02
_START_WIND_M_S2: Final = 0.15
_START_TRIM: Final = 0.03
_START_OFFSET_RAD: Final = 0.05


@compiled(LATERAL_STEP, VECTOR, MATRIX, MATRIX, ANY_VECTOR, NUMBER)
def _predict_tilt(step: LateralStep, x: Array, P: Array, Q: Array, stick: Array, yaw_rad: float) -> None:
    """Predict state and covariance of a `TiltFilter`: P = F P F' + Q."""
    x[:], F = predict_lateral(step, x, stick, yaw_rad)
    P[:] = predict_covariance(P, F, Q)


@compiled(VECTOR, MATRIX, MATRIX, VECTOR, ANY_VECTOR, VECTOR, NUMBER)
def _correct_tilt(x: Array, P: Array, H: Array, R: Array, z: Array, limit: Array, yaw_rad: float) -> float:
    """Correct a `TiltFilter` by a position and a plausible tilt, and return their log likelihood."""
    measured, offset, lever = len(z), len(x) - 3, len(x) - 1
    # The measured place is p + l tilt, a product of two states. Without measured tilt l counts as known.
    seen = z.copy()
    for row in range(2):
        tilt = x[CORE_FROM + row] if measured > 2 else 0.0
        H[row, CORE_FROM + row], H[row, lever] = x[lever], tilt
        seen[row] += x[lever] * tilt
    if measured > 2:
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        H[2, offset], H[2, offset + 1], H[3, offset], H[3, offset + 1] = c, -s, s, c
        along, across = c * x[offset] - s * x[offset + 1], s * x[offset] + c * x[offset + 1]
        if not max(abs(z[2] - x[CORE_FROM] - along), abs(z[3] - x[CORE_FROM + 1] - across)) <= TILT_GATE:
            measured = 2
    return update(x, P, H[:measured], R[:measured], seen[:measured].copy(), limit)


class TiltFilter:
    """Filter of the horizontal motion with a tilt model, in the inertial frame: state x and covariance P.

        x = position, velocity, core of the tilt model, servo, wind, trim, offset of the body frame, lever arm

    The offset is the tilt of the measured body against the axis of the thrust: markers are never glued on
    straight. It and the trim turn with the body; everything else but servo and lever arm is an inertial
    vector whose dynamics know no heading, so only the columns of the body-fixed states turn. The lever arm is
    the height of the measured origin above the centre of gravity, whose position is estimated.

    A tilt of None is not measured.
    """

    def __init__(self, model: Model, settings: ExtendedKalmanSettings) -> None:
        self._model, self._settings = model, settings
        self._layout = system = lateral_system(model, _ANY_PERIOD_S)
        self._prepared = lru_cache(maxsize=256)(self._prepare)
        self._trim = system.trim
        self._offset = slice(system.trim.stop, system.trim.stop + 2)
        self._lever = slice(self._offset.stop, self._offset.stop + 1)
        self._body = slice(self._trim.start, self._lever.stop)
        self._lever_deviation_m = settings.lever_arm_deviation_m if settings.measured_tilt else 0.0
        self.expect_noise(0.0, 0.0)
        size = self._lever.stop
        self._limit = np.full(size, np.inf)
        self._limit[self._trim], self._limit[self._offset] = TRIM_LIMIT, OFFSET_LIMIT_RAD
        self._limit[system.wind], self._limit[self._lever] = WIND_LIMIT_M_S2, LEVER_LIMIT_M
        self._H = np.zeros((4, size))
        self._H[:2, POSITION] = self._H[2:, system.tilt] = np.eye(2)
        self.x: Array = np.zeros(size)
        self.P: Array = np.zeros((size, size))
        self._forget_body()

    @property
    def tilt(self) -> Array:
        """Estimated tilt of the axis of the thrust, inertial frame, shape (2,)."""
        return self.x[self._layout.tilt]

    @property
    def lever_arm_m(self) -> tuple[float, float]:
        """Estimated lever arm, and its standard deviation."""
        return float(self.x[-1]), math.sqrt(max(self.P[-1, -1], 0.0))

    @property
    def origin_m(self) -> Array:
        """Where the origin of the subject is from the position, inertial frame, shape (2,)."""
        return np.asarray(self.x[self._lever] * self.tilt)

    @property
    def estimate(self) -> TiltEstimate:
        """The estimated tilt."""
        return self._layout.tilt_estimate(self.x.copy())

    def expect_noise(self, position_m: float, tilt: float) -> None:
        """Set the standard deviations of measured positions and tilts; at least those of the settings."""
        position_m = max(position_m, self._settings.position_noise_m)
        tilt = max(tilt, self._settings.tilt_noise)
        self.R: Array = np.array((position_m**2, position_m**2, tilt**2, tilt**2))

    def start(self, position_m: Array, velocity_m_s: Array, tilt: Array | None, yaw_rad: float) -> None:
        """Start in the air at a position and velocity, shape (2,); trim, offset and lever arm are kept."""
        system, x, P = self._layout, self.x, self.P
        x[POSITION], x[VELOCITY] = position_m, velocity_m_s
        x[system.core] = x[system.wind] = 0.0
        if tilt is not None:
            axis = tilt - heading_matrix(yaw_rad) @ x[self._offset]
            for place in range(system.core.start, system.core.stop, 2):
                if place != system.tilt_rate.start:
                    x[place : place + 2] = axis
        deviation = np.zeros(len(x))
        deviation[POSITION], deviation[VELOCITY] = _START_POSITION_M, _START_VELOCITY_M_S
        deviation[system.core], deviation[system.tilt_rate] = _START_TILT, _START_RATE
        deviation[system.servo], deviation[system.wind] = _START_SERVO, _START_WIND_M_S2
        self.P = np.diag(deviation**2)
        self.P[self._body, self._body] = P[self._body, self._body]

    def move(self, offset_m: Array) -> None:
        """Move the position by an offset, inertial frame, shape (2,)."""
        self.x[POSITION] += offset_m

    def stand(self, position_m: Array, tilt: Array | None, yaw_rad: float) -> None:
        """Start at rest on the floor, where a measured tilt shows the offset of the body frame."""
        self._forget_body()
        if tilt is not None:
            offset = heading_matrix(yaw_rad).T @ tilt
            self.x[self._offset] = np.clip(offset, -OFFSET_LIMIT_RAD, OFFSET_LIMIT_RAD)
            self.P[self._offset, self._offset] = LEVEL_FLOOR_RAD**2 * np.eye(2)
        self.start(position_m, np.zeros(2), tilt, yaw_rad)

    def take_over(self, known: TiltEstimate) -> None:
        """Continue another filter's estimate, after `start`."""
        system, x = self._layout, self.x
        x[system.core], x[system.servo], x[system.wind], x[system.trim] = known

    def set_servo(self, stick: Array) -> None:
        """Set the servo to a stick that has been acting for long, shape (2,)."""
        self.x[self._layout.servo] = stick + self.x[self._trim]

    def rest(self, stick: Array, period_s: float) -> None:
        """Predict by one period on the floor, where only the servo moves."""
        servo, target = self._layout.servo, stick + self.x[self._trim]
        step, _ = self._prepared(round(period_s, PERIOD_DIGITS))
        pole = step.transition[step.servo, step.servo]
        self.x[servo] = target + pole * (self.x[servo] - target)

    def predict(self, stick: Array, yaw_rad: float, period_s: float) -> None:
        """Predict by one period at a heading."""
        step, Q = self._prepared(round(period_s, PERIOD_DIGITS))
        _predict_tilt(step, self.x, self.P, Q, stick, yaw_rad)

    def _prepare(self, period_s: float) -> tuple[LateralStep, Array]:
        """Return the parameters of a period, and the covariance Q that it adds."""
        step = lateral_system(self._model, period_s).step
        return step, np.pad(process_noise(self._model, self._settings, period_s), (0, 1))

    def correct(self, position_m: Array, tilt: Array | None, yaw_rad: float) -> float:
        """Correct by a measured position and tilt, inertial frame, shape (2,).

        Returns the log likelihood of what was measured, without its constant. Raises
        `numpy.linalg.LinAlgError`: the covariance of the innovation is not positive definite.
        """
        z = position_m if tilt is None else np.concatenate((position_m, tilt))
        return _correct_tilt(self.x, self.P, self._H, self.R, z, self._limit, yaw_rad)

    def forget_offset(self) -> None:
        """Forget the offset of the body frame, as the measured tilts were wrong."""
        self._forget(self._offset, _START_OFFSET_RAD)

    def _forget_body(self) -> None:
        """Forget trim, offset and lever arm, as of a new vehicle."""
        self._forget(self._trim, _START_TRIM)
        self._forget(self._offset, _START_OFFSET_RAD)
        self._forget(self._lever, self._lever_deviation_m)
        self.x[self._lever] = self._model.lever_arm_m

    def _forget(self, states: slice, deviation: float) -> None:
        self.x[states] = self.P[states, :] = self.P[:, states] = 0.0
        self.P[states, states] = deviation**2 * np.eye(states.stop - states.start)
