"""What a stick does to a vehicle that lands, as estimated in flight."""

import math

import pytest

from rcopterx.transmitter_gateway.landing import RESPONSE_S, StickEffect

STEP_S = 0.02


def test_effect_of_a_stick_is_expected_with_its_lag_and_forgotten_in_a_second() -> None:
    """One step of 20 ms: 1 - exp(-0.02 / 0.15) of 1 m/s^2 is due, and 0.1 m/s are gained."""
    found = StickEffect()
    assert (found.sense, found.commanded_m_s2, found.work) == (1.0, 0.0, 0.0)
    found.note(0.0, STEP_S)
    assert (found.work, found.share) == (0.0, 0.0)
    found.commanded_m_s2 = 1.0
    found.note(0.1, STEP_S)
    due = 1.0 - math.exp(-0.02 / 0.15)
    assert found.work == pytest.approx(0.1 * due)
    assert found.share == pytest.approx(0.1 / (due * STEP_S))
    found.pause()
    found.note(5.0, 1.0)
    assert found.work == pytest.approx(0.1 * due * math.exp(-1.0))


def effect(commanded_m_s2: float, gained_m_s2: float, seconds: float = 0.6) -> StickEffect:
    """A stick that asks for an acceleration, and its vehicle, which has another one."""
    found = StickEffect()
    found.commanded_m_s2 = commanded_m_s2
    for n in range(round(seconds / STEP_S)):
        found.note(gained_m_s2 * n * STEP_S, STEP_S)
    return found


@pytest.mark.parametrize("commanded_m_s2", [-1.0, 1.0])
@pytest.mark.parametrize("share", [-1.0, -0.5, 0.0, 0.5, 1.0])
def test_effect_of_a_stick_is_the_share_of_what_was_asked_for_that_was_seen(
    commanded_m_s2: float, share: float
) -> None:
    found = effect(commanded_m_s2, share * commanded_m_s2, seconds=3.0)
    assert found.share == pytest.approx(share, abs=0.1)
    assert found.work == pytest.approx(share * 0.88, abs=0.1)


def test_effect_of_a_stick_that_was_not_moved_is_not_known() -> None:
    found = effect(0.0, -1.0, seconds=5.0)
    assert found.share == 0.0
    assert not found.turn_round()
    assert found.sense == 1.0


@pytest.mark.parametrize(("share", "turned"), [(-0.2, False), (-0.45, True), (1.0, False)])
def test_stick_is_turned_round_only_if_it_acts_the_wrong_way_round(share: float, turned: bool) -> None:
    found = effect(1.0, share, seconds=3.0)
    assert found.turn_round() == turned
    assert found.sense == (-1.0 if turned else 1.0)
    assert not found.turn_round()
    assert (found.share == 0.0) == turned


@pytest.mark.parametrize("asked_m_s2", [1.6, 5.0])
def test_stick_that_was_turned_round_is_not_given_up_while_the_vehicle_still_accelerates(
    asked_m_s2: float,
) -> None:
    found, speed_m_s, acting_m_s2 = StickEffect(), 0.0, -asked_m_s2
    found.commanded_m_s2 = asked_m_s2
    while found.sense > 0.0:
        speed_m_s += acting_m_s2 * STEP_S
        found.note(speed_m_s, STEP_S)
        found.turn_round()
    for _ in range(50):
        acting_m_s2 += STEP_S / RESPONSE_S * (asked_m_s2 - acting_m_s2)
        speed_m_s += acting_m_s2 * STEP_S
        found.note(speed_m_s, STEP_S)
        assert found.sense == -1.0
    assert found.share == pytest.approx(1.0, abs=0.1)


def test_effect_is_that_of_the_last_seconds() -> None:
    found = effect(1.0, -1.0, seconds=3.0)
    for n in range(round(4.0 / STEP_S)):
        found.note(-3.0 + n * STEP_S, STEP_S)
    assert found.share > 0.8


@pytest.mark.parametrize(
    ("commanded_m_s2", "share", "sense"),
    [
        (1.6, 0.0, 0.0),
        (1.6, 0.15, 0.0),
        (1.6, 0.25, 1.0),
        (1.6, -1.0, -1.0),
        (1.0, 0.0, 1.0),
        (-1.6, 0.0, 0.0),
    ],
)
def test_stick_that_has_asked_for_much_without_effect_is_given_up(
    commanded_m_s2: float, share: float, sense: float
) -> None:
    assert effect(commanded_m_s2, share * commanded_m_s2, seconds=1.5).sense == sense
