"""Promises of the thrust that a vehicle survives if its radio repeats it."""

import math

from hypothesis import given
from hypothesis import strategies as st

from rcopterx.transmitter_gateway.output_limiter import (
    BRAKING_M_S2,
    HELD_S,
    TOUCHDOWN_M_S,
    least_thrust_share,
)
from rcopterx.vehicles.state import GRAVITY_M_S2

heights_m = st.floats(0.1, 10.0)
climbs_m_s = st.floats(-3.0, 3.0)


def impact_m_s(height_m: float, climb_m_s: float, share: float) -> float:
    """Speed at the floor of a vehicle that keeps this thrust, then brakes; 0 if it stops above."""
    fall_m_s2 = (1.0 - share) * GRAVITY_M_S2
    squared = climb_m_s**2 + 2.0 * fall_m_s2 * height_m
    at_floor_m_s = math.sqrt(squared)
    end_m_s = climb_m_s - fall_m_s2 * HELD_S
    end_m = height_m + (climb_m_s + end_m_s) / 2.0 * HELD_S
    if end_m <= 0.0:
        return at_floor_m_s
    fallen = min(end_m_s, 0.0) ** 2 - 2.0 * BRAKING_M_S2 * end_m
    return math.sqrt(fallen) if fallen > 1e-6 else 0.0


@given(heights_m, climbs_m_s)
def test_a_repeated_thrust_ends_above_the_floor_or_slowly_on_it(height_m: float, climb_m_s: float) -> None:
    share = least_thrust_share(height_m, climb_m_s)
    assert 0.0 <= share <= 1.0
    if share < 1.0:
        assert impact_m_s(height_m, climb_m_s, share) <= TOUCHDOWN_M_S + 1e-3


@given(heights_m, st.floats(0.1, 5.0), climbs_m_s, st.floats(0.0, 2.0))
def test_a_vehicle_that_is_higher_and_climbs_may_have_less_thrust(
    height_m: float, higher_m: float, climb_m_s: float, faster_m_s: float
) -> None:
    low = least_thrust_share(max(height_m, 0.5), climb_m_s)
    if low < 1.0 and climb_m_s >= 0.0:
        assert least_thrust_share(max(height_m, 0.5) + higher_m, climb_m_s + faster_m_s) <= low + 1e-9


def test_thrust_is_not_limited_where_there_is_room_to_fall() -> None:
    assert least_thrust_share(5.0, 0.0) == 0.0
    assert least_thrust_share(1.5, 1.2) < 0.2


def test_no_more_than_the_thrust_of_a_hover_is_kept() -> None:
    assert least_thrust_share(0.3, -3.0) == 1.0


def test_slow_descents_to_the_floor_are_possible() -> None:
    for height_m in (0.1, 0.2, 0.5, 1.0):
        assert least_thrust_share(height_m, -0.4) < 0.93
