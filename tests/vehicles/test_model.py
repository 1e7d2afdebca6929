"""Promises of the model's parameters: what no vehicle can have is refused by name."""

import math
from dataclasses import replace

import pytest
from support.vehicle_types import COAXIAL_LAG


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"input_gain": (2.0, 2.0, 0.0, 111.0)}, "input_gain: must be above 0"),
        ({"gravity_m_s2": 0.0}, "gravity_m_s2: must be above 0"),
        ({"lag_s": (0.1, -0.1, 0.1, 0.1)}, "lag_s: must not be below 0"),
        ({"yaw_gyro": True, "lag_s": (0.1, 0.1, 0.1, 0.0)}, "lag_s: a yaw of rotors needs a lag"),
        ({"delay_s": -0.02}, "delay_s: must not be below 0"),
        ({"damping": (math.nan, 0.0, 0.0, 0.0)}, "damping: every number must be finite"),
        ({"input_min": (0.0, 0.0, 1.0, 0.0)}, "input_max: .* must be above input_min"),
        ({"state_min": (9.0,) * 7}, "state_max: .* must be above state_min"),
        ({"input_max": (1.0, 1.0, 1.2, 0.4)}, "input_max: inputs are normalised"),
    ],
)
def test_a_parameter_no_vehicle_can_have_is_refused_by_name(change: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        replace(COAXIAL_LAG, **change)  # type: ignore[arg-type]  # any field


def test_a_vehicle_without_lag_and_delay_is_allowed() -> None:
    assert replace(COAXIAL_LAG, lag_s=(0.0,) * 4, delay_s=0.0).delay_s == 0.0  # type: ignore[arg-type]  # four
