import math
from typing import Any

import pytest

from rcopterx.radios.limits import ArbiterLimits, Fence, LimitsError, SurveillanceLimits


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"hold_after_s": 0}, "hold_after_s"),
        ({"descend_after_s": 0.05}, "descend_after_s"),
        ({"cut_after_s": 0.1}, "descend_after_s"),
        ({"cut_after_s": math.nan}, "cut_after_s"),
        ({"command_age_s": 0.0}, "command_age_s"),
        ({"bridge_s": math.inf}, "bridge_s"),
        ({"hold_limit_s": -1}, "hold_limit_s"),
        ({"arm_low_s": 0}, "arm_low_s"),
        ({"low_thrust": 0}, "low_thrust"),
        ({"tolerance": -0.1}, "tolerance"),
        ({"descend_below_hover": 0}, "descend_below_hover"),
        ({"descend_rate_per_s": 0}, "descend_rate_per_s"),
        ({"upper": (1, 1, 1, -0.4)}, "upper: yaw"),
        ({"lower": (math.nan, -1, 0, -0.4)}, "upper: pitch"),
    ],
)
def test_wrong_arbiter_limits_name_the_field(change: dict[str, Any], field: str) -> None:
    with pytest.raises(LimitsError, match=f"^{field}"):
        ArbiterLimits(**change)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"tracking_hold_s": 0}, "tracking_hold_s"),
        ({"tracking_descend_s": 0.05}, "tracking_descend_s"),
        ({"minimum_distance_m": -0.3}, "minimum_distance_m"),
        ({"distance_hysteresis_m": 0}, "distance_hysteresis_m"),
        ({"other_pose_s": math.nan}, "other_pose_s"),
        ({"maximum_thrust_s": 0}, "maximum_thrust_s"),
        ({"maximum_jump_m": 0}, "maximum_jump_m"),
        ({"maximum_speed_m_s": 0}, "maximum_speed_m_s"),
        ({"jump_descend_s": 0}, "jump_descend_s"),
        ({"velocity_filter_s": 0}, "velocity_filter_s"),
    ],
)
def test_wrong_surveillance_limits_name_the_field(change: dict[str, Any], field: str) -> None:
    with pytest.raises(LimitsError, match=f"^{field}: "):
        SurveillanceLimits(**change)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"upper_m": (1, -2, 1)}, r"fence\.upper_m: y = -2 must be above lower_m y = -1"),
        ({"lower_m": (-1, -1, math.nan)}, r"fence\.upper_m: z"),
        ({"margin_m": -0.1}, r"fence\.margin_m"),
        ({"braking_m_s2": (2, 0, 2)}, r"fence\.braking_m_s2"),
    ],
)
def test_wrong_fences_name_the_field(change: dict[str, Any], words: str) -> None:
    with pytest.raises(LimitsError, match=words):
        Fence(**{"lower_m": (-1, -1, -1), "upper_m": (1, 1, 1), **change})


@pytest.mark.parametrize("climb_m_s", [-0.85, -0.4, 0.0, 0.4, 0.85])
@pytest.mark.parametrize("height_m", [-0.1, 0.0, 0.002, 0.01, 0.03, 0.05, 0.3])
def test_a_vehicle_falls_if_it_would_reach_the_floor_faster_than_it_may(
    height_m: float, climb_m_s: float
) -> None:
    limits, height, speed_m_s = ArbiterLimits(), height_m, climb_m_s
    while height > 0.0:
        height += speed_m_s * 1e-4
        speed_m_s -= 9.81 * 1e-4
    assert limits.falls(height_m, climb_m_s) == (height_m > 0.0 and -speed_m_s > limits.fall_m_s)


def test_a_vehicle_on_the_floor_does_not_fall_whatever_its_speed() -> None:
    assert not ArbiterLimits().falls(0.0, 3.0)
