"""Settings of the estimators, validated when a fleet file is read."""

from typing import Annotated

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0)]
FourPositive = tuple[Positive, Positive, Positive, Positive]


class EstimatorSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Settings of the innovation gate, common to all estimators that come with the package."""

    position_gate_m: Positive = 0.06
    """A pose is refused when it departs from the prediction by more than this plus five deviations."""
    yaw_gate_rad: Positive = 0.35
    """The same for the heading."""
    gate_limit_s: Positive = 0.25
    """Poses that agree with each other for so long while the gate refuses them are believed after all."""


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
    """Use roll and pitch where the vehicle has a tilt model and the tracker gives them."""
    tilt_noise: Positive = 0.004
    """Standard deviation of the measured tilt [rad]."""
    tilt_density: Positive | None = None
    """Random-walk density of the tilt rate [rad/s per root second]; by default from the model's
    uncertainty."""
    wind_rms_m_s2: Positive = 0.15
    """Standard deviation of the wind's acceleration, for vehicles with a tilt model."""
