"""Separation constraints: they imply the ellipsoid, and no two vehicles mirror each other for ever."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL_LAG

from rcopterx.control.controllers.cascade.clearance import (
    FLOOR_M,
    NARROWEST_M,
    SLOTS,
    TURN_RAD,
    clearances,
    normals,
)
from rcopterx.control.controllers.cascade.controller import CascadeController, CascadeSettings
from rcopterx.control.interfaces import Estimate, Obstacle
from rcopterx.control.references.trajectory import hold
from rcopterx.vehicles.state import Array

STAGES = 4
PERIOD_S = 0.02
coordinate = st.floats(-1.5, 1.5)
place = st.tuples(coordinate, coordinate, coordinate).map(np.array)
half_axis = st.floats(0.1, 0.8)


def still(place_m: Array, across_m: float = 0.35, up_m: float = 0.6, stages: int = STAGES) -> Obstacle:
    return Obstacle(np.tile(place_m, (stages, 1)), np.tile((across_m, across_m, up_m), (stages, 1)))


@given(place, place, place, half_axis, half_axis, st.lists(place, min_size=1, max_size=20))
def test_whatever_keeps_the_bounds_stays_outside_the_ellipsoid(
    own: Array, wanted: Array, other: Array, across_m: float, up_m: float, anywhere: list[Array]
) -> None:
    tiled = np.tile(own, (STAGES, 1))
    found = clearances(tiled, np.tile(wanted, (STAGES, 1)), [still(other, across_m, up_m)])
    for position in anywhere:
        least = found.least_m(np.full(STAGES, position[2]))[0, 0]
        direction = found.directions[0, 0]
        if not direction.any() or direction @ position[:2] < least:
            continue
        gap = (position - other) / [across_m, across_m, up_m]
        assert np.linalg.norm(gap) >= 1 - 1e-9


@given(place, place, half_axis, half_axis)
def test_a_plan_outside_the_ellipsoid_keeps_its_height(
    own: Array, other: Array, across_m: float, up_m: float
) -> None:
    """Bounds on the height push only plans that enter."""
    if np.linalg.norm((own - other) / [across_m, across_m, up_m]) < 1.0:
        return
    tiled = np.tile(own, (STAGES, 1))
    found = clearances(tiled, tiled, [still(other, across_m, up_m)])
    assert (found.lowest_m <= own[2] + 1e-9).all()
    assert (found.highest_m >= own[2] - 1e-9).all()


@given(place, place)
def test_two_vehicles_turn_round_each_other_the_same_way(gap: Array, way: Array) -> None:
    """Seen from the other side everything is the opposite, so both pass on the right of each other."""
    if np.linalg.norm(gap[:2]) < 0.01:
        return
    settled = np.array([1.0])
    one = normals(gap[None, None], way[None, None], settled)[1][0, 0]
    other = normals(-gap[None, None], -way[None, None], settled)[1][0, 0]
    assert one == pytest.approx(-other)
    assert np.linalg.norm(one) == pytest.approx(1.0)
    away = gap / np.linalg.norm(gap)
    assert one @ away >= np.cos(TURN_RAD) - 1e-9
    assert away[0] * one[1] - away[1] * one[0] >= -1e-9


@pytest.mark.parametrize("gap", [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
def test_there_is_a_way_out_of_the_same_place_and_from_straight_below(gap: tuple[float, ...]) -> None:
    way = -10 * np.array(gap)
    normal = normals(np.array(gap)[None, None], way[None, None], np.array([1.0]))[1][0, 0]
    assert np.isfinite(normal).all()
    assert np.linalg.norm(normal[:2]) > 0.4


def test_only_the_nearest_vehicles_are_kept_clear_of() -> None:
    own = np.zeros((STAGES, 3))
    many = [still(np.array([0.4 + 0.1 * number, 0.0, 0.0])) for number in range(SLOTS + 3)]
    found = clearances(own, own, many)
    assert found.centres_m.shape == (STAGES, SLOTS, 3)
    assert found.centres_m[0, :, 0].max() == pytest.approx(0.4 + 0.1 * (SLOTS - 1))


@given(st.floats(-0.5, 1.5), st.floats(-0.5, 1.5))
def test_heights_between_two_others_leave_a_range_to_plan_in(above_m: float, below_m: float) -> None:
    own = np.zeros((STAGES, 3))
    found = clearances(
        own, own, [still(np.array([0.01, 0, above_m])), still(np.array([0.0, 0.01, -below_m]))]
    )
    low, high = found.heights(np.array((-1.2, 1.2)))
    assert (high - low >= NARROWEST_M - 1e-9).all()
    assert (low >= -1.2 - 1e-9).all()
    assert (high <= 1.2 + 1e-9).all()


def test_a_vehicle_below_another_is_not_pressed_to_the_floor() -> None:
    own = np.tile((0.0, 0.0, 0.2), (STAGES, 1))
    found = clearances(own, own, [still(np.array([0.2, 0.0, 0.6]))])
    low, high = found.heights(np.array((0.0, 2.0)))
    assert (low == 0.0).all()
    assert high == pytest.approx(np.full(STAGES, FLOOR_M))


def flown(obstacles: list[Obstacle], goal: Array, steps: int = 250, **settings: object) -> Array:
    """Positions of a vehicle that flies its own plans exactly, from the origin at a height of a metre."""
    controller = CascadeController(COAXIAL_LAG, PERIOD_S, CascadeSettings(horizon=40, **settings))  # type: ignore[arg-type]  # free-form test settings
    motion = np.array([0, 0, 1.0, 0, 0, 0, 0, 0])
    estimate = Estimate(motion, COAXIAL_LAG.hover_input.copy(), np.zeros(4))
    controller.reset(estimate, COAXIAL_LAG.hover_input)
    track = []
    for _ in range(steps):
        controller.set_obstacles(obstacles)
        step = controller.step(estimate, hold(goal, 0.0, PERIOD_S, 40), COAXIAL_LAG.hover_input)
        assert step.fallback is None
        track.append(motion[:3])
        pole = np.exp(-PERIOD_S / np.array(COAXIAL_LAG.lag_s))
        actuator = pole * estimate.actuator + (1 - pole) * step.inputs[0]
        motion = np.concatenate((step.plan.samples[1, :4], step.plan.samples[1, 4:8]))
        estimate = Estimate(motion, actuator, np.zeros(4))
    return np.array(track)


@pytest.mark.parametrize("aside_m", [0.0, 0.05, -0.05, 0.2])
def test_a_vehicle_flies_round_another_one_that_stands_in_its_way(aside_m: float) -> None:
    obstacle = still(np.array([0.5, aside_m, 1.0]), stages=40)
    track = flown([obstacle], np.array([1.0, 0.0, 1.0]))
    assert track[-1] == pytest.approx([1.0, 0.0, 1.0], abs=0.05)
    gap = (track - obstacle.positions_m[0]) / [0.35, 0.35, 0.6]
    assert np.linalg.norm(gap, axis=1).min() > 0.97


def test_a_vehicle_climbs_past_another_one_above_it() -> None:
    obstacle = still(np.array([0.0, 0.0, 1.65]), stages=40)
    track = flown([obstacle], np.array([0.0, 0.0, 1.95]), steps=400)
    gap = (track - obstacle.positions_m[0]) / [0.35, 0.35, 0.6]
    assert np.linalg.norm(gap, axis=1).min() > 0.97
    # There is no room above the other one: it waits beside it, at the height it was sent to.
    assert track[-1, 2] == pytest.approx(1.95, abs=0.1)


def test_avoidance_can_be_switched_off() -> None:
    obstacle = still(np.array([0.5, 0.0, 1.0]), stages=40)
    track = flown([obstacle], np.array([1.0, 0.0, 1.0]), avoidance=False)
    assert np.abs(track[:, 1]).max() < 1e-3


def test_somebody_far_away_changes_nothing() -> None:
    alone = flown([], np.array([0.5, 0.2, 1.2]), steps=60)
    watched = flown([still(np.array([-1.0, -1.0, 1.0]), stages=40)], np.array([0.5, 0.2, 1.2]), steps=60)
    assert watched == pytest.approx(alone, abs=1e-4)


@pytest.mark.parametrize("solver", ["riccati", "osqp"])
def test_the_first_stick_brakes_before_an_obstacle_however_heavy_its_separation(solver: str) -> None:
    settings = CascadeSettings(horizon=40, solver=solver, separation_weight=1e8, time_limit_s=1.0)
    controller = CascadeController(COAXIAL_LAG, PERIOD_S, settings)
    motion = np.array([0, 0, 1.0, 0, 0.6, 0, 0, 0])
    estimate = Estimate(motion, COAXIAL_LAG.hover_input.copy(), np.zeros(4))
    controller.reset(estimate, COAXIAL_LAG.hover_input)
    controller.set_obstacles([still(np.array([0.3, 0.0, 1.0]), stages=40)])
    step = controller.step(
        estimate, hold(np.array([1.0, 0.0, 1.0]), 0.0, PERIOD_S, 40), COAXIAL_LAG.hover_input
    )
    assert step.inputs[0, 0] < 0.0
