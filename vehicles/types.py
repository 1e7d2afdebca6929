"""The vehicle types that come with rcopterx."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from rcopterx.vehicles.model import IDENTIFIED, UNIDENTIFIED, Model
from rcopterx.vehicles.state import GRAVITY_M_S2
from rcopterx.vehicles.tilt import TiltModel

TILT_LIMIT_RAD: Final = 0.35
"""Attitude at full stick: 20 degrees, the usual limit of the beginners' mode of indoor machines."""
YAW_RATE_LIMIT_RAD_S: Final = 3.5
"""Yaw rate at full stick: 200 degrees per second."""
YAW_RATE_TIME_CONSTANT_S: Final = 0.2
_HORIZONTAL_GAIN: Final = GRAVITY_M_S2 * math.tan(TILT_LIMIT_RAD)

QUADROTOR: Final = Model(
    kind="quadrotor",
    input_gain=(
        _HORIZONTAL_GAIN,
        _HORIZONTAL_GAIN,
        2 * GRAVITY_M_S2,
        YAW_RATE_LIMIT_RAD_S / YAW_RATE_TIME_CONSTANT_S,
    ),
    damping=(-0.35, -0.35, -0.2, -1 / YAW_RATE_TIME_CONSTANT_S),
    lag_s=(0.1, 0.1, 0.04, 0.03),
    delay_s=0.02,
    hover_thrust=0.5,
    input_min=(-1.0, -1.0, 0.0, -0.7),
    input_max=(1.0, 1.0, 1.0, 0.7),
    state_min=(-1.2, -1.2, 0.0, -1.5, -1.5, -1.0, -2.5),
    state_max=(1.2, 1.2, 2.0, 1.5, 1.5, 1.0, 2.5),
    gravity_m_s2=GRAVITY_M_S2,
)
"""Toy-class indoor quadrotor of some 20 to 60 g with a closed attitude loop.

Chosen, not identified: thrust-to-weight ratio of 2, closed attitude loop of 0.1 s (toy autopilots settle a
stick step within 0.2 to 0.3 s), motors and propellers of 40 ms, rotor drag of 0.35 /s as small open
propellers have. The yaw stick is limited to 0.7, which is the yaw rate bound of 2.5 rad/s.
"""


def tilt_limit_rad(model: Model) -> float:
    """Attitude at full pitch and roll stick, from b = g tan(tilt limit), pitch and roll averaged."""
    horizontal = (model.input_gain[0] + model.input_gain[1]) / 2
    return math.atan(horizontal / model.gravity_m_s2)


def thrust_acceleration(pitch_rad: float, roll_rad: float, thrust_m_s2: float) -> tuple[float, float, float]:
    """Forward, left and upward acceleration [m/s^2] by the tilted thrust in the heading frame, without
    gravity.

    Positive pitch accelerates forward (nose down), positive roll to the right (minus body y).
    """
    return (
        thrust_m_s2 * math.sin(pitch_rad) * math.cos(roll_rad),
        -thrust_m_s2 * math.sin(roll_rad),
        thrust_m_s2 * math.cos(pitch_rad) * math.cos(roll_rad),
    )


COAXIAL_LAG: Final = Model(
    kind="coaxial_lag",
    input_gain=(2.0, 2.1, 18.0, 111.0),
    damping=(-0.5, -0.4, 0.0, -5.0),
    lag_s=(0.06, 0.06, 0.08, 0.03),
    delay_s=0.02,
    hover_thrust=0.55,
    input_min=(-1.0, -1.0, 0.0, -0.4),
    input_max=(1.0, 1.0, 1.0, 0.4),
    state_min=(-1.2, -1.2, 0.0, -1.0, -1.3, -1.0, -2.5),
    state_max=(1.2, 1.2, 2.0, 1.0, 1.3, 1.0, 2.5),
    uncertainty=IDENTIFIED,
)
"""Blade mCX2 as the paper models it: parameters of [11], limits of the paper's section VI-A;
sticks that act as accelerations after a lag."""

COAXIAL: Final = replace(
    COAXIAL_LAG,
    kind="coaxial",
    lag_s=(0.12, 0.12, 0.11, 0.12),
    yaw_gyro=True,
    thrust_coupling=2.4,
    tilt=TiltModel(
        frequency_rad_s=12.7,
        damping_ratio=0.05,
        bar_time_constant_s=1.25,
        upper_phase_rad=-0.12,
        lower_phase_rad=0.297,
        upper_share=0.241,
        direct_m=0.011,
        servo_lag_s=0.03,
    ),
    uncertainty=UNIDENTIFIED,
)
"""A coaxial helicopter with stabilizer bar of which nothing else is known: gains and limits of the mCX2, tilt
of the Skybotix CoaX shrunk to between the mCX2 and itself (docs/helicopter.md). Its damping is the
least that such a vehicle is taken to have: damping that is assumed and not there makes the loop unstable,
damping that is there and not assumed costs nothing."""

TYPES: Final = MappingProxyType({model.kind: model for model in (COAXIAL, COAXIAL_LAG, QUADROTOR)})
"""Vehicle types by name."""
