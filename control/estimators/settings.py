"""Settings of the estimators, validated when a fleet file is read.

Process noise depends on the uncertainty of the model. A filter that believes a wrong model makes a loop
oscillate: it takes the late response of the rotors for wind, and the controller answers that. So a vehicle
with a tilt model of which only the type is known has much process noise in rates and actuators, and its
filter follows the measurements.
"""

import math
from typing import Annotated, Final, NamedTuple

import msgspec

from rcopterx.vehicles.model import CALM, Model
from rcopterx.vehicles.tuples import Four

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
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
    disturbance_noise: FourPositive = (0.8, 0.8, 0.3, 1.5)
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
    wind_rms_m_s2: Positive | None = None
    """Standard deviation of the wind's acceleration, for vehicles with a tilt model; by default from the
    model's uncertainty."""
    lever_arm_deviation_m: Annotated[float, msgspec.Meta(ge=0.0)] = 0.02
    """Standard deviation of the model's lever arm, which is estimated with a measured tilt; zero keeps it."""


# Downward disturbance over gravity of a thrust that hovers at 1 / (1 - 0.4) of its stick.
LOST_THRUST: Final = 0.7
ROOM_DENSITY: Final = 2.0 * CALM  # at most, of gusts by the wakes of others
GUSTY_DENSITY: Final = 10.0 * CALM  # of the real flight in docs/helicopter.md, as its wind beside the gusts
GUSTY_WIND_M_S2: Final = 0.15


class Noise(NamedTuple):
    """Settings of `ExtendedKalmanSettings` that depend on the model where they are left out."""

    velocity_noise: Four
    actuator_noise: Four
    disturbance_limit: Four
    tilt_density: float
    wind_rms_m_s2: float


def noise_of(model: Model, settings: ExtendedKalmanSettings) -> Noise:
    """Return the noise of a model by its uncertainty; without a tilt model that of an identified one.

    The wind is more than real wind, so that the filter takes what the model does not explain for wind at
    once. The limit of the disturbance of the height covers a battery that has lost 40 % of its thrust, of
    identified vehicles as of others.
    """
    horizontal, *_, yaw = model.uncertainty.axes
    graded, graded_yaw = horizontal.graded, yaw.graded
    if model.tilt is None:
        noise = Noise(
            (0.1, 0.1, 0.1, 0.5), (0.02, 0.02, 0.03, 0.01), (2.0, 2.0, 2.5, 15.0), graded(2.1, 10.0), 0.5
        )
    else:
        noise = Noise(
            velocity_noise=(graded(0.01, 0.05), graded(0.01, 0.05), 0.06, graded_yaw(0.05, 1.5)),
            actuator_noise=(0.02, 0.02, 0.06, graded_yaw(0.05, 0.2)),
            disturbance_limit=(2.0, 2.0, LOST_THRUST * model.gravity_m_s2, 15.0),
            tilt_density=graded(2.1, 10.0),
            wind_rms_m_s2=graded(0.5, 1.5) if settings.measured_tilt else graded(0.25, 1.5),
        )
        if settings.measured_tilt:
            noise = _in_gusts(noise, model.gust_density)
    given = {name: value for name in Noise._fields if (value := getattr(settings, name)) is not None}
    return noise._replace(**given)


def _in_gusts(noise: Noise, density: float) -> Noise:
    """Noise in air with more gusts than a closed room has: the more, the less is compensated as wind."""
    share = min(math.log(density / ROOM_DENSITY) / math.log(GUSTY_DENSITY / ROOM_DENSITY), 1.0)
    if share <= 0.0:
        return noise
    wind_m_s2 = noise.wind_rms_m_s2 ** (1.0 - share) * GUSTY_WIND_M_S2**share
    drift = max(density, noise.velocity_noise[0])
    return noise._replace(velocity_noise=(drift, drift, *noise.velocity_noise[2:]), wind_rms_m_s2=wind_m_s2)
