"""Promises of the offsets that dragged handles stand for."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus.messages import LeaderLink
from rcopterx.ground_station.page.view import link_to, place_beside

COORDINATE = st.floats(-5.0, 5.0)
PLACE = st.tuples(COORDINATE, COORDINATE, COORDINATE)
YAW = st.floats(-20.0, 20.0)
FRAME = st.sampled_from(["inertial", "heading"])


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
