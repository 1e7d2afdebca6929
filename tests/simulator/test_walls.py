"""Promises of walls and ceiling: what they do nearby, and nothing further away."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.conditions import HELICOPTER, HELICOPTERS, IDEAL
from support.vehicle_types import COAXIAL

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.laboratory import (
    ROTOR_RADIUS_M,
    Laboratory,
    ceiling_lift,
    wake_in_room,
    wall_slope,
)
from rcopterx.simulator.plant import STILL, BodyPose, Plant
from rcopterx.vehicles.tuples import Three

LOW: Three = (-2.5, -2.5, -0.1)
HIGH: Three = (2.5, 2.5, 3.0)
NEAR_ROOM = replace(
    IDEAL, coaxial_plant="helicopter", transport_delay_s=0.0, walls=True, volume_min_m=LOW, volume_max_m=HIGH
)


def flown(place_m: Three, conditions: Conditions, seconds: float = 0.2, stopped: bool = False) -> Plant:
    laboratory = Laboratory({"h1": COAXIAL}, {"h1": BodyPose(place_m)}, conditions)
    if stopped:
        laboratory.plants["h1"].stop_motors()
        laboratory.advance(0.0)
    for _ in range(round(seconds / 0.02)):
        laboratory.advance(0.02)
    return laboratory.plants["h1"]


def test_ceiling_adds_the_thrust_of_momentum_theory() -> None:
    factors = [1.0 + ceiling_lift(radii * ROTOR_RADIUS_M) for radii in (0.25, 0.5, 1.0, 3.0)]
    assert factors == pytest.approx([1.231, 1.073, 1.020, 1.0], abs=0.003)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_nearer_walls_and_ceilings_are_never_weaker(one_m: float, other_m: float) -> None:
    near, far = sorted((one_m, other_m))
    assert ceiling_lift(near) >= ceiling_lift(far) >= 0.0
    assert wall_slope(near) >= wall_slope(far) >= 0.0
    assert abs(ceiling_lift(far) - ceiling_lift(near)) <= 20.0 * (far - near)
    assert wall_slope(-near - 1e-9) == 0.0, "behind the wall"


@given(st.floats(-2.3, 2.3), st.floats(-2.3, 2.3), st.floats(0.0, 2.7))
def test_nothing_comes_back_from_walls_that_are_far(x: float, y: float, z: float) -> None:
    assert wake_in_room((x, y, z), LOW, HIGH) == STILL


@given(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5), st.floats(0.0, 3.0))
def test_a_room_acts_the_same_way_on_opposite_sides(x: float, y: float, z: float) -> None:
    here, there = wake_in_room((x, y, z), LOW, HIGH), wake_in_room((-x, -y, z), LOW, HIGH)
    assert here.down_m_s2 == there.down_m_s2 <= 0.0
    assert (here.slope_x_per_s2, here.slope_y_per_s2) == pytest.approx(
        (-there.slope_x_per_s2, -there.slope_y_per_s2)
    )


def test_a_helicopter_beside_a_wall_tilts_towards_it() -> None:
    ahead, left = flown((2.35, 0.0, 1.0), NEAR_ROOM).pose, flown((0.0, 2.35, 1.0), NEAR_ROOM).pose
    assert ahead.pitch_rad > 0.005 > abs(ahead.roll_rad)
    assert left.roll_rad < -0.005 < -abs(left.pitch_rad)


def test_a_ceiling_lifts_vehicles_whose_motors_run() -> None:
    def climb_m(**how: bool) -> float:
        near, free = (flown((0.0, 0.0, z), NEAR_ROOM, **how).position_m[2] - z for z in (2.95, 1.5))
        return near - free

    assert climb_m() > 0.01
    assert climb_m(stopped=True) == pytest.approx(0.0, abs=1e-6)


def test_helicopters_have_walls_and_fly_as_without_them_in_the_middle() -> None:
    assert HELICOPTER.walls
    middle = (0.5, -0.7, 1.5)
    walled, open_air = (flown(middle, replace(HELICOPTERS, walls=walls), 2.0) for walls in (True, False))
    assert walled.motion == open_air.motion
