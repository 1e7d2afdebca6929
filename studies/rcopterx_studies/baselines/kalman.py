"""Linear Kalman filter for velocities and accelerations, as the paper used one (its section V)."""

import numpy as np

from rcopterx.control.estimators.base import PoseEstimator
from rcopterx.control.estimators.settings import EstimatorSettings, FourPositive, Positive
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.models.prediction import actuator_response
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, YAW, Array, body_motion


class KalmanSettings(EstimatorSettings, frozen=True, kw_only=True):
    """Settings of the linear Kalman filter."""

    position_noise_m: Positive = 0.0005
    """Standard deviation of the measured position."""
    yaw_noise_rad: Positive = 0.003
    """Standard deviation of the measured yaw."""
    jerk_noise: FourPositive = (4.0, 4.0, 6.0, 40.0)
    """Random-walk density of the accelerations: x, y, z [m/s^2 per root second], yaw [rad/s^2 ...]."""


class KalmanEstimator(PoseEstimator):
    """Position, velocity and acceleration of each axis and of the yaw, in the inertial frame.

    Without inputs it lags behind their changes, and cannot separate disturbances, which are zero.
    """

    Settings = KalmanSettings

    def __init__(self, model: Model, period_s: float, settings: KalmanSettings) -> None:
        super().__init__(model, settings)
        noise_m, noise_rad = settings.position_noise_m, settings.yaw_noise_rad
        self._R = np.square([noise_m, noise_m, noise_m, noise_rad])
        self._jerk_density = np.square(settings.jerk_noise)
        self._actuator = model.hover_input
        self._prepare(period_s)
        self._start(np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE))

    def _prepare(self, period_s: float) -> None:
        """Compute transition F of one axis, shape (3, 3), and process noise Q of all, shape (4, 3, 3)."""
        t = self._prepared_s = period_s
        self._F = np.array([[1, t, t * t / 2], [0, 1, t], [0, 0, 1]])
        unit = np.array(
            [
                [t**5 / 20, t**4 / 8, t**3 / 6],
                [t**4 / 8, t**3 / 3, t**2 / 2],
                [t**3 / 6, t**2 / 2, t],
            ]
        )
        self._Q = self._jerk_density[:, None, None] * unit

    @property
    def estimate(self) -> Estimate:
        """The current estimate, with zero disturbance."""
        motion = body_motion(self._x[:, 0], self._x[:, 1])
        return Estimate(motion, self._actuator, np.zeros(INPUT_SIZE))

    def position_deviation_m(self) -> Array:
        """See `EstimatesUncertainty`."""
        return np.asarray(np.sqrt(self._P[:YAW, 0, 0]))

    def _set_actuators(self, applied_input: Array) -> None:
        self._actuator = applied_input.astype(float)

    def _start(self, pose: Array, rates: Array) -> None:
        self._x = np.column_stack([pose, rates, np.zeros(INPUT_SIZE)])
        self._P = np.zeros((INPUT_SIZE, 3, 3))
        self._P[:, 0, 0] = self._R
        self._P[:, 1, 1] = (0.25, 0.25, 0.25, 1.0)
        self._P[:, 2, 2] = (0.25, 0.25, 0.25, 4.0)

    def _move(self, offset: Array) -> None:
        self._x = self._x + np.outer(offset, (1.0, 0.0, 0.0))

    def predict(self, applied_input: Array, period_s: float) -> None:
        """Predict by one period (`PoseEstimator.predict`)."""
        self._begin(applied_input, period_s)
        if period_s != self._prepared_s:
            self._prepare(period_s)
        self._actuator = actuator_response(
            self._model, self._actuator, applied_input, float(self._x[YAW, 1]), period_s
        )
        self._x = self._x @ self._F.T
        self._P = self._F @ self._P @ self._F.T + self._Q

    def correct(self, measurement: Measurement) -> bool:
        """Correct the estimate by a pose (`PoseEstimator.correct`)."""
        deviation = np.sqrt(self._P[:, 0, 0] + self._R)
        accepted, pose = self._accept(measurement, self._x[:, 0], deviation)
        if pose is None:
            return accepted
        innovation = pose - self._x[:, 0]
        S = self._P[:, 0, 0] + self._R
        K = self._P[:, :, 0] / S[:, None]
        self._x = self._x + K * innovation[:, None]
        # P - K S K' is symmetric by construction and stays positive because S exceeds the noise variance.
        self._P = self._P - K[:, :, None] * (K * S[:, None])[:, None, :]
        return accepted
