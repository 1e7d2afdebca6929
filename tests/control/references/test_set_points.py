"""Promises of smooth ways: within their limits, from where the reference is, to rest at their end."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcopterx.control.references.columns import COLUMNS
from rcopterx.control.references.paths import FlightPath
from rcopterx.control.references.set_points import (
    PathReference,
    ProfileLimits,
    ProfileTransition,
    SetPointReference,
    smooth_way,
)

PERIOD_S = 0.01
START = np.array([0.3, -0.2, 1.0])
places = st.tuples(*3 * [st.floats(-2.0, 2.0)]).map(np.array)
headings = st.floats(-10.0, 10.0)


def three(low: float, high: float) -> st.SearchStrategy[tuple[float, float, float]]:
    return st.tuples(*3 * [st.floats(low, high)])


limits = st.builds(ProfileLimits, three(0.3, 3.0), three(0.3, 6.0), three(2.0, 40.0))


def flown(way: ProfileTransition, from_s: float = 0.0) -> np.ndarray:
    left_s = way.start_s + way.path.duration_s - from_s
    return way.sample(from_s, PERIOD_S, round(left_s / PERIOD_S) + 2).samples


def used(limit: ProfileLimits, rows: np.ndarray) -> float:
    jerk = np.diff(rows[:, 8:], axis=0) / PERIOD_S
    return float(limit.used(rows[1:], jerk).max())


def check(rows: np.ndarray, limit: ProfileLimits, place: np.ndarray, yaw_rad: float) -> None:
    assert rows[-1] == pytest.approx([*place, yaw_rad, *np.zeros(8)])
    assert used(limit, rows) <= 1.03
    for low in (0, 4):
        steps = np.diff(rows[:, low : low + 4], axis=0)
        assert steps == pytest.approx(PERIOD_S * 0.5 * (rows[1:] + rows[:-1])[:, low + 4 : low + 8], abs=2e-3)


@given(places, headings, headings, limits)
@settings(max_examples=20, deadline=None)
def test_a_way_from_rest_keeps_its_limits_and_ends_at_its_set_point(
    place: np.ndarray, start_rad: float, end_rad: float, limit: ProfileLimits
) -> None:
    rows = flown(smooth_way(limit, place, end_rad, SetPointReference(START, start_rad), 0.0))
    assert rows[0] == pytest.approx([*START, start_rad, *np.zeros(8)])
    check(rows, limit, place, end_rad)


@given(places, places, headings, limits, st.lists(st.floats(0.0, 1.0), min_size=1, max_size=3))
@settings(max_examples=20, deadline=None)
def test_new_set_points_on_the_way_keep_the_limits_without_a_jump(
    first: np.ndarray, second: np.ndarray, yaw_rad: float, limit: ProfileLimits, shares: list[float]
) -> None:
    way, at_s = smooth_way(limit, first, 0.0, SetPointReference(START, 0.0), 0.0), 0.0
    for number, share in enumerate(shares):
        before = way
        at_s += share * (way.start_s + way.path.duration_s - at_s)
        place = (second, first)[number % 2]
        way = smooth_way(limit, place, yaw_rad, before, at_s)
        rows = flown(way, at_s)
        assert rows[0] == pytest.approx(before.sample(at_s, PERIOD_S, 1).samples[0])
        check(rows, limit, place, yaw_rad)


def test_a_trajectory_that_is_too_fast_is_left_without_a_jump() -> None:
    knots = np.zeros((2, 1 + COLUMNS))
    knots[1, :2] = 2.0, 4.0
    knots[:, 5] = 2.0
    limit = ProfileLimits(3 * (1.0,), 3 * (1.0,), 3 * (9.0,))
    rows = flown(smooth_way(limit, START, 0.0, PathReference(FlightPath(knots), 0.0), 1.0), 1.0)
    assert rows[0, :8] == pytest.approx([2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0])
    assert rows[-1] == pytest.approx([*START, *np.zeros(9)])
    assert np.abs(rows[:, 4]).max() <= 2.01
    assert np.abs(np.diff(rows[:, 0])).max() <= 2.01 * PERIOD_S


def test_after_its_end_a_way_rests_exactly_at_its_set_point() -> None:
    end_m = np.array([0.7, 0.1, 1.3])
    way = smooth_way(ProfileLimits(*3 * [(1.0, 1.0, 1.0)]), end_m, 0.4, SetPointReference(START, 0.0), 2.0)
    rest = way.sample(way.start_s + way.path.duration_s + 0.1, PERIOD_S, 3).samples
    assert rest[:, :4].tolist() == 3 * [[*end_m, 0.4]]
    assert not rest[:, 4:].any()


def test_a_way_takes_no_longer_than_its_limits_require() -> None:
    limit = ProfileLimits(3 * (1.0,), 3 * (100.0,), 3 * (1e4,))
    way = smooth_way(limit, np.array([2.0, 0.0, 0.0]), 0.0, SetPointReference(np.zeros(3), 0.0), 5.0)
    shortest_s = 1.875 * 2.0
    assert shortest_s <= way.path.duration_s <= 1.1 * shortest_s
    assert not way.finished(5.0 + 0.9 * shortest_s)
    assert way.finished(5.0 + 1.1 * shortest_s)
