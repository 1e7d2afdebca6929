"""Promises of the scene's shapes, and of the offsets that dragged handles stand for."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.plans import plan_of

from rcopterx.bus.messages import LeaderLink
from rcopterx.ground_station.geometry import (
    arrow,
    box_edges,
    heading_quaternion,
    link_to,
    on_level,
    place_beside,
    plan_segments,
    polyline,
)

COORDINATE = st.floats(-5.0, 5.0)
PLACE = st.tuples(COORDINATE, COORDINATE, COORDINATE)
YAW = st.floats(-20.0, 20.0)
FRAME = st.sampled_from(["inertial", "heading"])


def test_a_plan_is_a_line_through_its_stages() -> None:
    segments = plan_segments(plan_of("h1", position_m=(1.0, 2.0, 3.0)))
    assert segments.shape == (19, 2, 3)
    assert (segments == [1.0, 2.0, 3.0]).all()
    assert plan_segments(None).shape == (1, 2, 3)


def test_a_line_of_one_point_or_none_is_not_there() -> None:
    assert polyline(np.zeros((0, 3))).shape == polyline(np.ones((1, 3))).shape == (1, 2, 3)


def test_a_box_has_an_edge_along_each_axis_at_every_corner() -> None:
    low, high = np.array([-1.0, -2.0, 0.0]), np.array([1.0, 2.0, 3.0])
    lengths = np.abs(np.diff(box_edges(low, high), axis=1))[:, 0]
    assert sorted(map(tuple, lengths)) == 4 * [(0, 0, 3)] + 4 * [(0, 4, 0)] + 4 * [(2, 0, 0)]


def test_a_heading_is_a_turn_about_the_vertical() -> None:
    assert heading_quaternion(np.pi) == pytest.approx((0.0, 0.0, 0.0, 1.0))


def test_an_offset_in_the_heading_frame_turns_with_the_leader() -> None:
    link = LeaderLink(leader="h1", offset_m=(-1.0, 0.0, 0.2), frame="heading")
    assert place_beside(link, (1.0, 1.0, 1.0), math.pi / 2) == pytest.approx((1.0, 0.0, 1.2))
    fixed = LeaderLink(leader="h1", offset_m=(-1.0, 0.0, 0.2))
    assert place_beside(fixed, (1.0, 1.0, 1.0), math.pi / 2) == pytest.approx((0.0, 1.0, 1.2))


@given(PLACE, PLACE, YAW, FRAME)
def test_a_follower_that_is_dragged_keeps_itself_where_it_was_dragged_to(
    place: tuple[float, float, float], leader: tuple[float, float, float], yaw_rad: float, frame: str
) -> None:
    before = LeaderLink(leader="h1", offset_m=(0.5, 0.0, 0.0), yaw_offset_rad=0.3, frame=frame, weight=2.0)
    after = link_to(before, place, leader, yaw_rad)
    assert place_beside(after, leader, yaw_rad) == pytest.approx(place, abs=2e-3)
    assert (after.leader, after.yaw_offset_rad, after.frame, after.weight) == ("h1", 0.3, frame, 2.0)


@given(PLACE, PLACE.filter(lambda direction: abs(direction[2]) > 1e-3), st.floats(0.0, 2.0))
def test_a_click_meets_the_level_in_front_of_the_camera_or_not_at_all(
    origin: tuple[float, float, float], direction: tuple[float, float, float], height_m: float
) -> None:
    place = on_level(origin, direction, height_m)
    if (height_m - origin[2]) * direction[2] <= 0.0:
        assert place is None
        return
    assert place is not None
    assert place[2] == height_m
    along = np.subtract(place, origin)
    assert np.cross(along, direction) == pytest.approx(np.zeros(3), abs=1e-6 * (1 + np.linalg.norm(along)))


def test_a_level_ray_meets_no_level() -> None:
    assert on_level((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 1.0) is None


def test_an_arrow_points_along_its_vector_with_barbs_on_both_sides() -> None:
    shaft, *barbs = arrow((1.0, 2.0, 0.5), (0.4, 0.0))
    assert shaft.tolist() == [[1.0, 2.0, 0.5], [1.4, 2.0, 0.5]]
    for barb in barbs:
        assert barb[0].tolist() == shaft[1].tolist()
        assert np.linalg.norm(barb[1] - barb[0]) == pytest.approx(0.1)
        assert 1.25 < barb[1][0] < 1.4
    assert barbs[0][1][1] == pytest.approx(4.0 - barbs[1][1][1])
