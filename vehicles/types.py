"""The vehicle types that come with rcopterx."""

from dataclasses import replace
from types import MappingProxyType
from typing import Final

from rcopterx.vehicles.model import IDENTIFIED, UNIDENTIFIED, Model
from rcopterx.vehicles.tilt import TiltModel
from rcopterx.vehicles.types import QUADROTOR

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
