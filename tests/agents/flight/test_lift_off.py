"""Promises of the lift-off: thrust that rises to a peak, what a vehicle may do unseen, and an end."""

import math
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st
from support.vehicle_types import TYPES

from rcopterx.agents.flight.lift_off import (
    BASE_SHARE,
    LIFTED_M,
    PEAK_S,
    PEAK_SHARE,
    SINKING_S,
    SPOOL_UP_S,
    LiftOff,
)
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2, U_THRUST

models = st.sampled_from(list(TYPES.values()))
times_s = st.floats(0.0, 1e4)


def rotor_shares(model: Model, lift_off: LiftOff, from_s: float) -> list[float]:
    """Thrust of a rotor with the lag of the model, as a share of the hover thrust, every millisecond."""
    lag_s, acting, shares = max(float(model.lag_s[U_THRUST]), 1e-3), 0.0, []
    for number in range(round(1000 * (PEAK_S + SINKING_S))):
        acting += (1.0 - math.exp(-0.001 / lag_s)) * (lift_off.thrust(from_s + 0.001 * number) - acting)
        shares.append(acting / float(model.hover_input[U_THRUST]))
    return shares


@given(models, times_s)
def test_the_rotor_rises_to_the_peak_once_and_falls_again(model: Model, begun_s: float) -> None:
    lift_off = LiftOff(model)
    lift_off.begin(begun_s, 0.0)
    shares = rotor_shares(model, lift_off, begun_s)
    highest = shares.index(max(shares))
    assert max(shares) <= PEAK_SHARE * 1.02
    assert all(first <= second + 1e-9 for first, second in pairwise(shares[:highest]))
    assert all(first >= second - 0.01 for first, second in pairwise(shares[highest:]))
    assert shares[-1] < BASE_SHARE


@given(models, st.floats(0.95, 1.4))
def test_a_vehicle_that_is_not_seen_rises_no_further_than_stated(model: Model, weight: float) -> None:
    lift_off = LiftOff(model)
    lift_off.begin(0.0, 0.0)
    height_m = climb_m_s = highest_m = 0.0
    for share in rotor_shares(model, lift_off, 0.0):
        climb_m_s += 0.001 * GRAVITY_M_S2 * (share / weight - 1.0)
        height_m += 0.001 * climb_m_s
        if height_m <= 0.0:
            height_m, climb_m_s = 0.0, max(climb_m_s, 0.0)
        highest_m = max(highest_m, height_m)
    assert highest_m < 0.25 * ((PEAK_SHARE - weight) / (PEAK_SHARE - 1.0)) ** 2 + 0.005


@given(models, times_s, st.floats(0.0, 5.0))
def test_without_poses_the_thrust_stays_where_it_lifts_no_vehicle(
    model: Model, begun_s: float, blind_s: float
) -> None:
    lift_off = LiftOff(model)
    lift_off.begin(begun_s, 0.0)
    now_s = begun_s + SPOOL_UP_S + blind_s
    lift_off.pause(now_s)
    led = 1.0 + PEAK_SHARE
    assert lift_off.thrust(now_s - 1e-6) <= led * BASE_SHARE * model.hover_input[U_THRUST]
    assert not lift_off.failed(now_s + PEAK_S - SPOOL_UP_S)


@given(models, times_s, st.floats(-1.0, 1.0))
def test_it_is_seen_a_little_above_where_it_stood_and_nowhere_else(
    model: Model, begun_s: float, floor_m: float
) -> None:
    lift_off = LiftOff(model)
    assert not lift_off.lifted(floor_m + 1.0)
    lift_off.begin(begun_s, floor_m)
    assert not lift_off.lifted(floor_m + 0.5 * LIFTED_M)
    assert lift_off.lifted(floor_m + 2 * LIFTED_M)


@given(models, times_s)
def test_a_vehicle_that_stands_is_given_up_after_a_while(model: Model, begun_s: float) -> None:
    lift_off = LiftOff(model)
    assert not lift_off.failed(begun_s)
    lift_off.begin(begun_s, 0.0)
    assert not lift_off.failed(begun_s + PEAK_S)
    assert lift_off.failed(begun_s + 8.0)
    lift_off.end()
    assert not lift_off.failed(begun_s + 8.0)
    assert lift_off.thrust(begun_s + 8.0) == 0.0
