"""The vehicle types that come with rcopterx."""

from types import MappingProxyType
from typing import Final

from vehicles.model import Model
from vehicles.quadrotor import QUADROTOR

COAXIAL: Final = Model(
    kind="coaxial",
    input_gain=(2.0, 2.1, 18.0, 111.0),
    damping=(-0.5, -0.4, 0.0, -5.0),
    lag_s=(0.06, 0.06, 0.08, 0.03),
    delay_s=0.02,
    hover_thrust=0.55,
    input_min=(-1.0, -1.0, 0.0, -0.4),
    input_max=(1.0, 1.0, 1.0, 0.4),
    state_min=(-1.2, -1.2, 0.0, -1.0, -1.3, -1.0, -2.5),
    state_max=(1.2, 1.2, 2.0, 1.0, 1.3, 1.0, 2.5),
    state_scale=(1.2, 1.2, 1.0, 10.0, 1.1, 1.3, 1.0, 25.0, 1.0, 1.0, 1.0),
    input_scale=(1.0, 1.0, 0.5, 0.4),
    state_shift=(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    input_shift=(0.0, 0.0, 0.5, 0.0),
)
"""Blade mCX2: parameters of [11], limits and scaling of the paper's section VI-A (control.md 2, 3, 6)."""

TYPES: Final = MappingProxyType({model.kind: model for model in (COAXIAL, QUADROTOR)})
"""Vehicle types by name."""
