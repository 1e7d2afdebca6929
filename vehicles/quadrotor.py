"""Quadrotor in attitude mode: on-board electronics hold the roll, pitch and yaw rate that the sticks command.

Seen from the sticks it has the structure of equation (1): horizontal acceleration follows the commanded
attitude with a lag, b = g tan(tilt limit), and the true vehicle departs from it by the geometry of its tilt.
"""

import math
from typing import Final

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2

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
