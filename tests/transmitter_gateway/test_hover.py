"""Promises of the hover thrust: learnt in steady flight, never far from the calibrated one."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.transmitter_gateway.hover import SEEN_WITHIN_S, STEADY_M_S, HoverThrust
from rcopterx.transmitter_gateway.inputs import Position
from rcopterx.transmitter_gateway.surveillance import Track

PERIOD_S = 0.02
FLOOR_M = -0.3


def track(height_m: float = 1.0, climb_m_s: float = 0.0, seen_s: float = 0.0) -> Track:
    position: Position = (0.0, 0.0, FLOOR_M + height_m)
    return Track(1, 1, seen_s, position, seen_s, velocity_m_s=(0.0, 0.0, climb_m_s))


def flown(thrust: float, seen: Track | None, seconds: float = 5.0, now_s: float = 0.0) -> float:
    hover = HoverThrust(0.55, 0.08, 0.1)
    for _ in range(round(seconds / PERIOD_S)):
        hover.note(thrust, PERIOD_S, seen, FLOOR_M, now_s)
    return hover.value


@pytest.mark.parametrize("thrust", [0.5, 0.55, 0.6])
def test_thrust_of_a_steady_hover_is_learnt_within_seconds(thrust: float) -> None:
    assert flown(thrust, track()) == pytest.approx(thrust, abs=0.001)
    assert flown(thrust, track(), 0.2) == pytest.approx(0.55 + (thrust - 0.55) / 2, abs=0.001)
    assert flown(thrust, track(), 0.8) == pytest.approx(0.55 + (thrust - 0.55) * 4 / 5, abs=0.001)


def test_later_thrust_is_filtered_with_one_second() -> None:
    hover = HoverThrust(0.55, 0.08, 0.1)
    for thrust, seconds in ((0.55, 10.0), (0.6, 1.0)):
        for _ in range(round(seconds / PERIOD_S)):
            hover.note(thrust, PERIOD_S, track(), FLOOR_M, 0.0)
    assert hover.value == pytest.approx(0.55 + 0.05 * 0.632, abs=0.001)


@pytest.mark.parametrize(
    ("thrust", "seen", "now_s"),
    [
        (0.6, None, 0.0),
        (0.6, Track(1, 1, 0.0), 0.0),
        (0.6, track(), 0.11),
        (0.6, track(height_m=0.09), 0.0),
        (0.6, track(climb_m_s=0.11), 0.0),
        (0.6, track(climb_m_s=-0.11), 0.0),
        (0.68, track(), 0.0),
        (0.0, track(), 0.0),
    ],
    ids=["unknown", "never seen", "unseen", "low", "climbs", "sinks", "too much", "none"],
)
def test_thrust_that_is_not_that_of_a_hover_is_not_learnt(
    thrust: float, seen: Track | None, now_s: float
) -> None:
    assert flown(thrust, seen, now_s=now_s) == 0.55


def test_correction_ends_at_its_limit_and_can_be_switched_off() -> None:
    assert flown(0.66, track()) == pytest.approx(0.63)
    assert flown(0.44, track()) == pytest.approx(0.47)
    hover = HoverThrust(0.55, 0.0, 0.1)
    hover.note(0.56, 1.0, track(), FLOOR_M, 0.0)
    assert hover.value == 0.55


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 10)), max_size=30))
def test_hover_thrust_stays_near_the_calibrated_one_whatever_is_flown(
    flight: list[tuple[float, float]],
) -> None:
    hover = HoverThrust(0.55, 0.08, 0.1)
    for thrust, elapsed_s in flight:
        hover.note(thrust, elapsed_s, track(), FLOOR_M, 0.0)
        assert abs(hover.value - 0.55) <= 0.08 + 1e-12


def test_limits_of_a_steady_hover_met_exactly_still_count() -> None:
    seen = track(height_m=0.125 - FLOOR_M, climb_m_s=STEADY_M_S)
    hover = HoverThrust(0.5, 0.25, 0.125)
    hover.note(0.875, PERIOD_S, seen, 0.0, SEEN_WITHIN_S)
    assert hover.value > 0.5
