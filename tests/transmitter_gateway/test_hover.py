"""Promises of the hover thrust: learnt in any flight that is seen, within its limits."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.transmitter_gateway.landing import RESPONSE_S
from rcopterx.transmitter_gateway.output_limiter import LEAST, SETTLING_S, HoverThrust
from rcopterx.vehicles.state import GRAVITY_M_S2

PERIOD_S = 0.02
CALIBRATED = 0.55
GAIN_M_S2 = GRAVITY_M_S2 / CALIBRATED


def hover_thrust(largest_correction: float = 0.35) -> HoverThrust:
    return HoverThrust(CALIBRATED, largest_correction, GAIN_M_S2)


def begun(largest_correction: float = 0.35) -> HoverThrust:
    """In the air, at the calibrated thrust."""
    hover = hover_thrust(largest_correction)
    hover.begin(CALIBRATED, CALIBRATED)
    return hover


def hovered(thrust: float, seconds: float, learns: HoverThrust | None = None) -> HoverThrust:
    """After a flight at one height."""
    hover = learns or begun()
    for _ in range(round(seconds / PERIOD_S)):
        hover.note(thrust, PERIOD_S, 0.0)
    return hover


@pytest.mark.parametrize("thrust", [0.21, 0.5, 0.55, 0.6, 0.89])
def test_thrust_of_a_hover_is_learnt_within_seconds(thrust: float) -> None:
    error = thrust - CALIBRATED
    assert hovered(thrust, 4.0).value == pytest.approx(thrust, abs=0.1 * abs(error) + 1e-9)
    assert abs(hovered(thrust, 0.5).value - thrust) < 0.6 * abs(error) + 1e-9


@pytest.mark.parametrize("true", [0.25, 0.45, 0.55, 0.7, 0.85])
@pytest.mark.parametrize("swing", [0.1, 0.3])
def test_thrust_is_learnt_while_the_vehicle_climbs_and_sinks(true: float, swing: float) -> None:
    hover, acting, climb_m_s = hover_thrust(), true, 0.0
    hover.begin(CALIBRATED, acting)
    for step in range(200):
        thrust = true * (1.0 + swing * math.sin(step * PERIOD_S * 3.0))
        acting -= math.expm1(-PERIOD_S / RESPONSE_S) * (thrust - acting)
        climb_m_s += GRAVITY_M_S2 * (acting / true - 1.0) * PERIOD_S
        hover.note(thrust, PERIOD_S, climb_m_s)
    assert hover.value == pytest.approx(true, abs=0.03)


def test_later_thrust_is_filtered_with_one_second() -> None:
    """Beside the lag of the rotor."""
    hover = hovered(0.6, 1.0, hovered(CALIBRATED, 20.0))
    assert hover.value == pytest.approx(CALIBRATED + 0.05 * 0.57, abs=0.002)


def test_thrust_of_a_vehicle_that_is_not_seen_is_not_learnt_but_its_climb_predicted() -> None:
    hover = hovered(CALIBRATED, 20.0)
    for _ in range(50):
        hover.note(1.1 * CALIBRATED, PERIOD_S, None)
    assert hover.value == pytest.approx(CALIBRATED)
    assert hover.climb_m_s == pytest.approx(0.1 * GRAVITY_M_S2 * (1.0 - RESPONSE_S), abs=0.02)
    hover.note(CALIBRATED, PERIOD_S, 0.3)
    assert hover.climb_m_s == 0.3
    assert hover.value == pytest.approx(CALIBRATED)  # The climb since it was seen last has other causes.


def test_climb_rate_after_a_pause_is_not_learnt() -> None:
    hover = hovered(CALIBRATED, 20.0)
    hover.note(CALIBRATED, 0.2, -1.5)
    assert hover.value == pytest.approx(CALIBRATED)


def test_correction_ends_at_its_limit_and_can_be_switched_off() -> None:
    assert hovered(1.0, 9.0).value == pytest.approx(CALIBRATED + 0.35)
    assert hovered(0.1, 9.0).value == pytest.approx(CALIBRATED - 0.35)
    assert hovered(0.6, 9.0, begun(0.0)).value == CALIBRATED


def test_descent_thrust_is_lower_while_the_hover_thrust_is_doubtful() -> None:
    assert hover_thrust().below(0.1) == pytest.approx(0.75 * CALIBRATED)
    assert hovered(CALIBRATED, SETTLING_S + 0.2).below(0.1) == pytest.approx(0.825 * CALIBRATED, rel=0.01)
    assert hovered(CALIBRATED, 60.0).below(0.1) == pytest.approx(0.9 * CALIBRATED, rel=0.002)


def test_another_flight_begins_at_a_given_thrust() -> None:
    hover = hovered(0.8, 9.0)
    hover.begin(0.7, 0.75)
    assert hover.value == pytest.approx(0.7)
    assert hover.below(0.0) == pytest.approx(0.85 * 0.7)


@given(
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 10), st.none() | st.floats(-9, 9)), max_size=30),
    st.floats(0.05, 0.95),
)
def test_hover_thrust_stays_in_its_limits_whatever_is_flown(
    flight: list[tuple[float, float, float | None]], calibrated: float
) -> None:
    hover = HoverThrust(calibrated, 0.35, GAIN_M_S2)
    for thrust, elapsed_s, climb_m_s in flight:
        hover.note(thrust, elapsed_s, climb_m_s)
        assert max(LEAST * calibrated, calibrated - 0.35) <= hover.value <= min(1.0, calibrated + 0.35)
        assert math.isfinite(hover.climb_m_s)


def test_a_descent_trusts_no_thrust_that_only_the_newest_poses_explain() -> None:
    """Those of a body that stands in the place of the vehicle, which climbs meanwhile."""
    hover = hovered(1.1 * CALIBRATED, 1.0, hovered(CALIBRATED, 20.0))
    assert hover.value > 1.05 * CALIBRATED
    assert hover.trusted < 1.03 * CALIBRATED
    lighter = hovered(0.9 * CALIBRATED, 1.0, hovered(CALIBRATED, 20.0))
    assert lighter.trusted == lighter.value
