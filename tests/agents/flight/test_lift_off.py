"""Promises of the lift-off: a pulse of thrust, what a vehicle may do unseen, and an end."""

import math
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.agents.flight.lift_off import (
    FAILED_S,
    LIFTED_M,
    NEAR_FLOOR,
    SPOOL_UP_S,
    TRY_S,
    LiftOff,
)
from rcopterx.fleet.vehicle_types import vehicle_type
from rcopterx.vehicles.lift_off import RESTING_SHARE
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2, MOTION_SIZE, U_THRUST, ZD_BODY, Z

models = st.sampled_from(
    [
        vehicle_type(kind).model
        for kind in ("coaxial", "crazyflie", "betaflight", "mavlink_quadrotor", "ardupilot_quadrotor")
    ]
)
times_s = st.floats(0.0, 1e4)
CONTROL_S = 0.02
GROUND_EFFECT_M = 0.1
STEP_S = 0.002
HIGHEST_M, HARDEST_M_S = 0.15, 1.0  # of a vehicle like its model that nothing sees
LIGHT, LIGHT_HIGHEST_M, LIGHT_HARDEST_M_S = 0.9, 0.2, 0.9
HEAVY = 1.22


def near_floor_of(model: Model) -> float:
    return NEAR_FLOOR if model.airframe == "coaxial" else 1.0


def rotor_shares(model: Model, from_s: float = 0.0, lag_factor: float = 1.0) -> list[float]:
    """Thrust of a rotor on the floor, as a share of that which lifts a vehicle like its model."""
    lift_off = LiftOff(model)
    lift_off.begin(from_s, 0.0)
    carries = float(model.hover_input[U_THRUST]) / near_floor_of(model)
    lag_s, acting, shares = max(lag_factor * float(model.lag_s[U_THRUST]), 1e-3), 0.0, []
    for number in range(round(FAILED_S / STEP_S)):
        # Sent once in a control period, and held.
        sent_s = CONTROL_S * (0.5 + math.floor(number * STEP_S / CONTROL_S + 1e-6))
        acting += (1.0 - math.exp(-STEP_S / lag_s)) * (lift_off.thrust(from_s + sent_s) / carries - acting)
        shares.append(acting)
    return shares


def hop(model: Model, weight: float, lag_factor: float = 1.0) -> tuple[list[float], float]:
    """Heights of a vehicle that nothing sees, each `STEP_S`, and the speed of its hardest touchdown.

    Its weight is a multiple of that of its model.
    """
    near_floor = near_floor_of(model)
    height_m = climb_m_s = hardest_m_s = 0.0
    heights_m = []
    for share in rotor_shares(model, lag_factor=lag_factor):
        carried = (1.0 + (near_floor - 1.0) * math.exp(-height_m / GROUND_EFFECT_M)) / near_floor
        climb_m_s += STEP_S * GRAVITY_M_S2 * (share * carried / weight - 1.0)
        height_m += STEP_S * climb_m_s
        if height_m <= 0.0:
            hardest_m_s = max(hardest_m_s, -climb_m_s if heights_m and heights_m[-1] > 0.0 else 0.0)
            height_m, climb_m_s = 0.0, max(climb_m_s, 0.0)
        heights_m.append(height_m)
    return heights_m, hardest_m_s


@given(models, times_s)
def test_the_rotor_rises_to_one_peak_and_falls_to_a_thrust_that_carries_nothing(
    model: Model, begun_s: float
) -> None:
    shares = rotor_shares(model, begun_s)[: round((SPOOL_UP_S + TRY_S) / STEP_S)]
    highest = shares.index(max(shares))
    slowest = highest + shares[highest:].index(min(shares[highest:]))
    assert all(first <= second + 0.01 for first, second in pairwise(shares[:highest]))
    assert all(first >= second for first, second in pairwise(shares[highest:slowest]))
    assert all(share < RESTING_SHARE + 0.01 for share in shares[slowest:])
    assert shares[-1] > RESTING_SHARE - 0.01


@given(models, st.floats(1.0, 2.0), st.floats(0.8, 1.2))
def test_a_vehicle_not_lighter_than_its_model_that_nothing_sees_hops_low_and_lands_gently(
    model: Model, weight: float, lag_factor: float
) -> None:
    heights_m, hardest_m_s = hop(model, weight, lag_factor)
    assert max(heights_m) < HIGHEST_M
    assert hardest_m_s < HARDEST_M_S


@given(models, st.floats(LIGHT, 1.0))
def test_a_light_vehicle_that_nothing_sees_hops_and_lands_gently_within_its_try(
    model: Model, weight: float
) -> None:
    heights_m, hardest_m_s = hop(model, weight)
    assert max(heights_m) < LIGHT_HIGHEST_M
    assert hardest_m_s < LIGHT_HARDEST_M_S
    assert heights_m[-1] < 0.1


@given(models, st.floats(0.8, HEAVY))
def test_every_vehicle_within_the_declared_range_is_seen_to_lift(model: Model, weight: float) -> None:
    assert max(hop(model, weight)[0]) > LIFTED_M


@given(models, st.floats(0.87, 1.2), st.floats(0.008, 0.03))
def test_the_height_of_a_lift_shows_the_weight_and_the_climb_rate(
    model: Model, weight: float, seen_m: float
) -> None:
    heights_m, _ = hop(model, weight)
    lifted = next((n for n, height_m in enumerate(heights_m) if height_m > seen_m), None)
    if lifted is None:
        return
    lift_off, motion = LiftOff(model), np.zeros(MOTION_SIZE)
    lift_off.begin(0.0, 0.0)
    motion[Z] = heights_m[lifted]
    now_s = lifted * STEP_S + model.delay_s
    lifted_off, carrying = lift_off.handed_over(motion, now_s)
    share = carrying * near_floor_of(model) / float(model.hover_input[U_THRUST])
    assert math.isclose(share, weight, rel_tol=0.08)
    climb_m_s = (heights_m[lifted] - heights_m[lifted - 1]) / STEP_S
    assert math.isclose(lifted_off.motion[ZD_BODY], climb_m_s, abs_tol=0.1)


@given(models, times_s, st.floats(0.0, 5.0))
def test_without_poses_the_thrust_stays_where_it_lifts_no_vehicle(
    model: Model, begun_s: float, blind_s: float
) -> None:
    lift_off = LiftOff(model)
    lift_off.begin(begun_s, 0.0)
    now_s = begun_s + SPOOL_UP_S + blind_s
    lift_off.pause(now_s)
    assert lift_off.thrust(now_s) <= 1.001 * RESTING_SHARE * model.hover_input[U_THRUST]
    assert not lift_off.failed(now_s + TRY_S)


@given(models, times_s, st.floats(-1.0, 1.0))
def test_it_is_seen_a_little_above_where_it_stood_and_nowhere_else(
    model: Model, begun_s: float, floor_m: float
) -> None:
    lift_off = LiftOff(model)
    lifting_s = begun_s + SPOOL_UP_S
    assert not lift_off.lifted(floor_m + 1.0, lifting_s)
    lift_off.begin(begun_s, floor_m)
    assert not lift_off.lifted(floor_m + 0.5 * LIFTED_M, lifting_s)
    assert lift_off.lifted(floor_m + 2 * LIFTED_M, lifting_s)


@given(models, times_s, st.floats(0.0, 0.99))
def test_a_vehicle_that_is_shown_higher_before_its_rotor_can_lift_it_has_not_lifted(
    model: Model, begun_s: float, share: float
) -> None:
    lift_off = LiftOff(model)
    lift_off.begin(begun_s + 0.55, 0.0)
    assert not lift_off.lifted(0.1, begun_s + share * (0.55 + SPOOL_UP_S))


@given(models, st.floats(0.0, 100.0), st.floats(SPOOL_UP_S, FAILED_S - TRY_S))
def test_a_lift_off_that_is_resumed_brakes_and_ends_no_later(
    model: Model, begun_s: float, lifted_s: float
) -> None:
    lift_off, carries = LiftOff(model), float(model.hover_input[U_THRUST])
    lift_off.begin(begun_s, 0.0)
    lift_off.end()
    resumed_s = begun_s + lifted_s
    lift_off.resume(resumed_s)
    assert lift_off.under_way
    assert lift_off.thrust(resumed_s) == 0.0
    assert lift_off.thrust(resumed_s + 0.5) < 0.8 * carries
    assert lift_off.failed(begun_s + FAILED_S + 1e-6)


@given(models, st.floats(0.0, 0.0019), st.floats(0.003, 0.1))
def test_a_vehicle_that_has_lifted_stands_again_if_it_is_seen_low_for_a_while(
    model: Model, low_m: float, high_m: float
) -> None:
    lift_off = LiftOff(model)
    lift_off.begin(0.0, 0.0)
    lift_off.see(high_m, 1.0)
    assert not lift_off.undone(2.0)
    lift_off.see(low_m, 2.0)
    assert not lift_off.undone(2.1)
    lift_off.see(low_m, 2.13)
    assert lift_off.undone(2.13)
    lift_off.see(high_m, 2.2)
    assert not lift_off.undone(2.2)


@given(models, times_s)
def test_a_vehicle_that_stands_is_given_up_after_a_while(model: Model, begun_s: float) -> None:
    lift_off = LiftOff(model)
    assert not lift_off.failed(begun_s)
    lift_off.begin(begun_s, 0.0)
    assert not lift_off.failed(begun_s + SPOOL_UP_S + TRY_S)
    assert lift_off.failed(begun_s + FAILED_S + 0.1)
    lift_off.end()
    assert not lift_off.failed(begun_s + FAILED_S + 0.1)
    assert lift_off.thrust(begun_s + FAILED_S) == 0.0
