"""Kalman filter for the horizontal motion of a vehicle with a tilt model, in the inertial frame.

    x = position, velocity, core of the tilt model, servo, wind, trim, offset of the body frame

The offset is the tilt of the measured body against the axis of the thrust: markers are never glued on
straight. It and the trim turn with the body; everything else but the servo is an inertial vector whose
dynamics know no heading, so only the columns of the body-fixed states turn.
"""

from typing import Final

import numpy as np

from rcopterx.control.estimators.kalman_equations import predict_covariance, update
from rcopterx.control.estimators.settings import ExtendedKalmanSettings, noise_of
from rcopterx.control.interfaces import TiltEstimate
from rcopterx.control.models.lateral import (
    POSITION,
    VELOCITY,
    WIND_CORRELATION_S,
    lateral_system,
    predict_lateral,
)
from rcopterx.control.models.linear import cached_by_period, noise_over
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array, heading_matrix, turned_about_z

TRIM_LIMIT: Final = 0.3
OFFSET_LIMIT_RAD: Final = 0.2
WIND_LIMIT_M_S2: Final = 1.5
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
_TRIM_DENSITY: Final = 0.002
_OFFSET_DENSITY: Final = 0.0005
_SERVO_DENSITY: Final = 0.01


class TiltFilter:
    """State x and covariance P of one vehicle with a tilt model; a tilt of None is not measured."""

    def __init__(self, model: Model, settings: ExtendedKalmanSettings) -> None:
        self._model, self._settings = model, settings
        self._layout = system = lateral_system(model, _ANY_PERIOD_S)
        self._trim = system.trim
        self._offset = slice(system.trim.stop, system.trim.stop + 2)
        self._body = slice(self._trim.start, self._offset.stop)
        self.expect_noise(0.0, 0.0)
        size = system.size + 4
        self._limit = np.full(size, np.inf)
        self._limit[self._trim], self._limit[self._offset] = TRIM_LIMIT, OFFSET_LIMIT_RAD
        self._limit[system.wind] = WIND_LIMIT_M_S2
        self._H = np.zeros((4, size))
        self._H[:2, POSITION] = self._H[2:, system.tilt] = np.eye(2)
        self.x: Array = np.zeros(size)
        self.P: Array = np.zeros((size, size))
        self._forget_body()

    @property
    def position_m(self) -> Array:
        """Estimated position, inertial frame, shape (2,)."""
        return self.x[POSITION]

    @property
    def velocity_m_s(self) -> Array:
        """Estimated velocity, inertial frame, shape (2,)."""
        return self.x[VELOCITY]

    @property
    def tilt(self) -> Array:
        """Estimated tilt of the axis of the thrust, inertial frame, shape (2,)."""
        return self.x[self._layout.tilt]

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
        """Start in the air at a position and velocity, shape (2,); trim and offset of the body are kept."""
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
        step = lateral_system(self._model, period_s).step
        pole = step.transition[step.servo, step.servo]
        self.x[servo] = target + pole * (self.x[servo] - target)

    def predict(self, stick: Array, yaw_rad: float, period_s: float) -> None:
        """Predict by one period at a heading: P = F P F' + Q."""
        self.x, F = predict_lateral(lateral_system(self._model, period_s).step, self.x, stick, yaw_rad)
        self.P = predict_covariance(self.P, F, process_noise(self._model, self._settings, period_s))

    def correct(self, position_m: Array, tilt: Array | None, yaw_rad: float) -> None:
        """Correct by a measured position and tilt, inertial frame, shape (2,).

        Raises `numpy.linalg.LinAlgError`: the covariance of the innovation is not positive definite.
        """
        H, R, z = self._H[:2], self.R[:2], position_m
        if tilt is not None:
            offset = turned_about_z(self.x[self._offset], yaw_rad)
            if max(map(abs, (tilt - self.tilt - offset).tolist())) <= TILT_GATE:
                H, R, z = self._H.copy(), self.R, np.concatenate((position_m, tilt))
                H[2:, self._offset] = heading_matrix(yaw_rad)
        self.x, self.P = update(self.x, self.P, H, R, z, self._limit)

    def forget_offset(self) -> None:
        """Forget the offset of the body frame, as the measured tilts were wrong."""
        self._forget(self._offset, _START_OFFSET_RAD)

    def _forget_body(self) -> None:
        """Forget trim and offset, as of a new vehicle."""
        self._forget(self._trim, _START_TRIM)
        self._forget(self._offset, _START_OFFSET_RAD)

    def _forget(self, states: slice, deviation: float) -> None:
        self.x[states] = self.P[states, :] = self.P[:, states] = 0.0
        self.P[states, states] = deviation**2 * np.eye(2)


@cached_by_period
def process_noise(model: Model, settings: ExtendedKalmanSettings, period_s: float) -> Array:
    """Return the covariance Q that a period adds, shape (n, n): Van Loan's integral plus random walks."""
    noise, system = noise_of(model, settings), lateral_system(model, period_s)
    size = system.size
    density = np.zeros(size)
    density[VELOCITY] = noise.velocity_noise[0] ** 2
    density[system.tilt_rate] = noise.tilt_density**2
    density[system.wind] = 2.0 * noise.wind_rms_m_s2**2 / WIND_CORRELATION_S
    Q = np.zeros((size + 4, size + 4))
    Q[:size, :size] = noise_over(system.continuous, density, period_s)
    trim, offset = slice(size, size + 2), slice(size + 2, size + 4)
    for states, walk in ((system.servo, _SERVO_DENSITY), (trim, _TRIM_DENSITY), (offset, _OFFSET_DENSITY)):
        Q[states, states] += period_s * walk**2 * np.eye(2)
    return Q
