"""Extended Kalman filter on model (1) with actuator lags and disturbances (docs/formulas.md).

Sixteen states: eight of the motion, four actuators, four disturbance accelerations as random walks. The
estimated disturbance is what makes the predictive controllers free of offset.
"""

from typing import Final, NamedTuple

import numpy as np

from rcopterx.control.estimators.base import PoseEstimator, body_motion
from rcopterx.control.estimators.linearization import ACTUATOR, DISTURBANCE, SIZE, Linearization
from rcopterx.control.estimators.model_noise import model_noise
from rcopterx.control.estimators.noise_meter import NoiseMeter
from rcopterx.control.estimators.settings import EstimatorSettings, FourPositive, Positive
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.models.linear import PERIOD_DIGITS, ByPeriod
from rcopterx.control.models.prediction import actuator_response, parameters, split
from rcopterx.native.kalman import FAR, INDEFINITE, correct_lags, predict_lags
from rcopterx.native.noise import measure_noise
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_THRUST, YAW, Array

_LIFTING_FRACTION: Final = 0.9
"""Modelled thrust over weight from which a standing vehicle may lift."""
_MOVED_M: Final = 0.01
"""Departure from where it stood that shows that a vehicle stands no more."""
_START_DEVIATION: Final = np.array(
    [0.001, 0.001, 0.001, 0.005, 0.3, 0.3, 0.3, 1.0, 0.03, 0.03, 0.03, 0.03, 0.3, 0.3, 0.8, 3.0]
)
"""Standard deviation of the state at a start."""
_ANYWHERE: Final = np.full(INPUT_SIZE, np.inf)


class LagPeriod(NamedTuple):
    """What the prediction of a period needs to know, in the order in which `predict_lags` takes it."""

    vehicle: Array
    step_s: float
    steps: int
    constant: Array
    process: Array


class ExtendedKalmanSettings(EstimatorSettings, frozen=True, kw_only=True):
    """Settings of the extended Kalman filter; four-vectors are body x, body y, z, yaw."""

    position_noise_m: Positive = 0.0005
    """Standard deviation of the measured position."""
    yaw_noise_rad: Positive = 0.003
    """Standard deviation of the measured yaw."""
    disturbance_noise: FourPositive = (0.4, 0.4, 0.3, 1.5)
    """Random-walk density of the disturbances [m/s^2, rad/s^2 per root second]."""
    velocity_noise: FourPositive | None = None
    """Random-walk density of velocities and yaw rate [m/s, rad/s per root second]; by default from the
    model's uncertainty."""
    actuator_noise: FourPositive | None = None
    """Random-walk density of the actuator states [1 per root second]; by default from the model's
    uncertainty."""
    disturbance_limit: FourPositive | None = None
    """Estimated disturbances stay within plus and minus these [m/s^2, rad/s^2]; by default from the model's
    uncertainty."""
    measured_tilt: bool = True
    """Take in roll and pitch where the vehicle has a tilt model and the tracker gives them."""
    tilt_noise: Positive = 0.004
    """Standard deviation of the measured tilt [rad]."""
    tilt_density: Positive | None = None
    """Random-walk density of the tilt rate [rad/s per root second]; by default from the model's
    uncertainty."""
    wind_rms_m_s2: Positive = 0.15
    """Standard deviation of the wind's acceleration, for vehicles with a tilt model."""


class LagKalmanEstimator(PoseEstimator):
    """Motion, actuators and disturbances from poses and applied inputs.

    On the floor the model does not hold: with the thrust off it falls, and a filter would explain its rest by
    an upward disturbance of one gravity, which a controller would then trust at take-off. Hence *standing*:
    from a start on, and whenever the upward disturbance reaches its limit while the thrust cannot carry the
    weight (only a floor pushes so hard), the vehicle is taken to rest where it is measured, without
    disturbance, until the modelled thrust comes near the weight or the pose moves by a centimetre. A start in
    the air ends standing with the first prediction, because the applied thrust carries the weight.

    Parameters
    ----------
    model
        The vehicle.
    period_s
        Nominal period; others are prepared when `predict` first sees them.
    settings
        Noise densities, limits and gate.
    """

    Settings = ExtendedKalmanSettings

    def __init__(self, model: Model, period_s: float, settings: ExtendedKalmanSettings) -> None:
        super().__init__(model, settings)
        noise_m, noise_rad = settings.position_noise_m, settings.yaw_noise_rad
        self._least_noise = np.array((noise_m, noise_m, noise_m, noise_rad))
        self._measurement_variance = np.square(self._least_noise)
        self._noise = NoiseMeter(INPUT_SIZE)
        self._since_pose_s = 0.0
        noise = model_noise(model)
        densities = (
            [0.0] * 4,
            settings.velocity_noise or noise.velocity,
            settings.actuator_noise or noise.actuator,
            settings.disturbance_noise,
        )
        self._densities = np.square(np.concatenate(densities))
        self._limit = np.array(settings.disturbance_limit or noise.disturbance_limit)
        # Kernels change the state in place; estimates get copies of it.
        self._state: Array = np.zeros(SIZE)
        self._motion = self._state[:ACTUATOR]
        self._actuator, self._disturbance = self._state[ACTUATOR:DISTURBANCE], self._state[DISTURBANCE:]
        self._actuator[:] = model.hover_input
        self._pose: Array = np.zeros(INPUT_SIZE)
        """Measured last, its heading unwrapped."""
        self._periods: ByPeriod[LagPeriod] = ByPeriod(self._prepared)
        self._periods[round(period_s, PERIOD_DIGITS)]  # prepared before the flight
        self._start(np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE))

    def _prepared(self, period_s: float) -> LagPeriod:
        constant = Linearization(self._model, period_s).constant
        process = np.diag(period_s * self._densities)
        return LagPeriod(parameters(self._model), *split(period_s), constant, process)

    @property
    def estimate(self) -> Estimate:
        """The current estimate."""
        state = self._state.copy()
        return Estimate(state[:ACTUATOR], state[ACTUATOR:DISTURBANCE], state[DISTURBANCE:])

    @property
    def standing(self) -> bool:
        """Whether the vehicle is taken to rest on the floor."""
        return self._standing

    @property
    def covariance(self) -> Array:
        """Covariance of motion, actuators and disturbances, shape (16, 16)."""
        return self._covariance

    def position_deviation_m(self) -> Array:
        """See `TellsUncertainty`."""
        return np.asarray(np.sqrt(self._covariance.diagonal()[:YAW]))

    def _settle(self, applied_input: Array) -> None:
        self._actuator[:] = applied_input

    def _start(self, pose: Array, rates: Array) -> None:
        self._motion[:] = body_motion(pose, rates)
        self._disturbance[:] = 0.0
        self._covariance = np.diag(np.square(_START_DEVIATION))
        self._standing = not rates.any()
        self._stood_at_m = pose[:YAW].copy()

    def take_over(self, estimate: Estimate) -> None:
        """Start from another estimator's estimate, its disturbance included."""
        super().take_over(estimate)
        self._disturbance[:] = np.clip(estimate.disturbance, -self._limit, self._limit)

    def correct(self, measurement: Measurement) -> bool:
        """Take in a pose (`PoseEstimator.correct`)."""
        if self._yaw_known and not self._standing:
            gate = self._gate
            if self._correct(measurement.position_m, measurement.yaw_rad, gate.near):
                gate.note_near()
                return True
        return super().correct(measurement)

    def _thrust_carries(self) -> bool:
        thrust = self._model.input_gain[U_THRUST] * float(self._actuator[U_THRUST])
        return thrust > _LIFTING_FRACTION * self._model.gravity_m_s2

    def _move(self, applied_input: Array, period_s: float) -> None:
        self._since_pose_s += period_s
        if self._standing:
            self._actuator[:] = actuator_response(self._model, self._actuator, applied_input, 0.0, period_s)
            self._standing = not self._thrust_carries()
        else:
            prepared = self._periods[round(period_s, PERIOD_DIGITS)]
            predict_lags(self._state, self._covariance, applied_input, *prepared)

    def _deviation(self) -> Array:
        variance = self._covariance.diagonal()[:INPUT_SIZE] + self._measurement_variance
        return np.asarray(np.sqrt(variance))

    def _predicted_pose(self) -> Array:
        return self._state[:INPUT_SIZE].copy()

    def _correct(self, position_m: Array, yaw_rad: float, near: Array) -> bool:
        """Take in a pose if it is near the expected one; False, and nothing has changed, if not."""
        outcome = correct_lags(
            self._state,
            self._covariance,
            position_m,
            yaw_rad,
            self._motion,
            near,
            self._noise.memory,
            self._since_pose_s,
            self._least_noise,
            self._measurement_variance,
            self._limit,
            self._pose,
        )
        if outcome == FAR:
            return False
        if outcome == INDEFINITE:
            raise np.linalg.LinAlgError("the covariance of the filter is not positive definite")
        self._since_pose_s = 0.0
        if self._disturbance[U_THRUST] >= self._limit[U_THRUST]:
            self._stand_if_pushed()
        return True

    def _stand_if_pushed(self) -> None:
        """Stand if the upward disturbance, which is at its limit, must be the floor's."""
        if not self._thrust_carries():
            self._start(self._motion[:INPUT_SIZE], np.zeros(INPUT_SIZE))

    def _stay(self, pose: Array) -> None:
        """Take in a pose while standing."""
        memory, variance = self._noise.memory, self._measurement_variance
        measure_noise(memory, pose, self._since_pose_s, self._least_noise, variance)
        self._since_pose_s = 0.0
        self._motion[:INPUT_SIZE] = pose
        self._standing = bool((np.abs(pose[:YAW] - self._stood_at_m) < _MOVED_M).all())

    def _take_in(self, innovation: Array) -> None:
        pose = self._predicted_pose() + innovation
        if self._standing:
            self._stay(pose)
        else:
            self._correct(pose[:YAW], float(pose[YAW]), _ANYWHERE)
