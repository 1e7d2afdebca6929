"""How emulated autopilots tilt and turn their vehicle: heading control, and the body under its rate loops.

ArduCopter 4.8-dev moves a target heading with limited acceleration to that of the set point, and controls
towards the target (`AC_AttitudeControl::input_quaternion`); PX4 1.16.1 controls towards the set point itself
(`mc_att_control`). Both add the yaw rate of the set point.
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple

from rcopterx.radios.mavlink_settings import ARDUPILOT, PX4
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.tilt import TiltModel

STEP_S: Final = 0.0025  # of both firmwares at 400 Hz


class HeadingGains(NamedTuple):
    """Default parameters of a firmware, and its rate loop.

    `rate_time_s` is chosen so that the heading lags behind a step of the yaw rate to 1.75 rad/s as measured
    in its own simulation, after 0.6 s: ArduCopter 0.38 s, PX4 0.21 s.
    """

    gain_per_s: float  # `ATC_ANG_YAW_P`, `MC_YAW_P`
    acceleration_rad_s2: float  # `ATC_ACCEL_Y_MAX`; infinite where the set point is the target
    rate_time_s: float


GAINS: Final = {
    ARDUPILOT: HeadingGains(4.5, math.radians(270.0), 0.25),
    PX4: HeadingGains(2.8, math.inf, 0.23),
}
SHAPING_S: Final = 0.15  # `ATC_INPUT_TC`
MOTOR_S: Final = 0.05  # chosen
TILTS: Final = {ARDUPILOT: TiltModel(6.2, 0.92, 0.04), PX4: TiltModel(11.5, 0.57, 0.05)}
"""As steps and pulses of 4 degrees showed in the simulations of ArduCopter and PX4."""


class HeadingControl:
    """Yaw rate for a heading; angles clockwise from north."""

    def __init__(self, autopilot: int, full_rate_rad_s: float) -> None:
        self._gains, self._full = GAINS[autopilot], full_rate_rad_s
        self._target_rad, self._target_rate = 0.0, 0.0

    def rest(self, heading_rad: float) -> None:
        """Begin at a heading."""
        self._target_rad, self._target_rate = heading_rad, 0.0

    def advance(self, heading_rad: float, rate_rad_s: float, duration_s: float) -> None:
        """Move the target to the heading of a set point with its rate."""
        if math.isinf(self._gains.acceleration_rad_s2):
            self._target_rad, self._target_rate = heading_rad, rate_rad_s
            return
        steps = math.ceil(duration_s / STEP_S)
        for _ in range(steps):
            self._approach(heading_rad, rate_rad_s, duration_s / steps)

    def _approach(self, heading_rad: float, rate_rad_s: float, step_s: float) -> None:
        most = self._gains.acceleration_rad_s2
        error_rad = math.remainder(heading_rad - self._target_rad, math.tau)
        near_rad, away_rad = most * SHAPING_S**2, abs(error_rad)
        braked = math.sqrt(2 * most * max(away_rad - near_rad / 2, 0.0))
        closing = away_rad / SHAPING_S if away_rad < near_rad else braked
        wanted = self._limited(rate_rad_s + math.copysign(closing, error_rad))
        change = min(max(wanted - self._target_rate, -most * step_s), most * step_s)
        self._target_rate += change
        self._target_rad += self._target_rate * step_s

    def rate_rad_s(self, yaw_rad: float) -> float:
        """Return the yaw rate that the rate loop gets at a heading of the vehicle."""
        error_rad = math.remainder(self._target_rad - yaw_rad, math.tau)
        return self._limited(self._target_rate + self._gains.gain_per_s * error_rad)

    def _limited(self, rate_rad_s: float) -> float:
        return min(max(rate_rad_s, -self._full), self._full)


def body_of(model: Model, autopilot: int, full_tilt_rad: float, full_rate_rad_s: float) -> Model:
    """Return what an autopilot makes of a vehicle: it tilts and turns as its set points and loops say."""
    tilt, time_s = model.gravity_m_s2 * math.tan(full_tilt_rad), GAINS[autopilot].rate_time_s
    return replace(
        model,
        input_gain=(tilt, tilt, model.input_gain[2], full_rate_rad_s / time_s),
        damping=(*model.damping[:3], -1.0 / time_s),
        lag_s=(*model.lag_s[:3], MOTOR_S),
        yaw_gyro=True,
        tilt=TILTS[autopilot],
    )
