"""Trajectories: smooth from rest to rest, and refused where a vehicle cannot fly them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL_LAG

from rcopterx.bus.message import FloatArray, InvalidMessageError
from rcopterx.bus.requests import Fly
from rcopterx.control.references.path_shapes import circle, figure_eight, spiral, through
from rcopterx.control.references.paths import (
    MAX_KNOTS,
    FlightPath,
    PathError,
    begun_from,
    path_problem,
    run_in_time_s,
)
from rcopterx.control.references.set_points import PathReference

STEP_S = 1e-3

lengths = st.floats(0.1, 1.0)
periods = st.floats(2.0, 20.0)
turns = st.floats(0.3, 3.0) | st.floats(-3.0, -0.3)
headings = st.sampled_from(["fixed", "along"])


def paths() -> st.SearchStrategy[FlightPath]:
    middle = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.5, 1.5))
    row = st.tuples(st.floats(0.5, 4.0), *[st.floats(-1.0, 1.0)] * 3, st.floats(-4.0, 4.0))
    waypoints = st.lists(row, min_size=2, max_size=6)
    return st.one_of(
        st.builds(circle, middle, lengths, periods, turns, headings),
        st.builds(spiral, middle, st.tuples(lengths, lengths), lengths, periods, turns, headings),
        st.builds(figure_eight, middle, st.tuples(lengths, lengths), periods, turns, headings),
        waypoints.map(
            lambda rows: through(
                [(sum(row[0] for row in rows[: i + 1]), *row[1:]) for i, row in enumerate(rows)]
            )
        ),
    )


@settings(max_examples=60)
@given(paths())
def test_every_path_is_a_valid_request_and_one_that_does_not_end_at_rest_is_none(path: FlightPath) -> None:
    Fly(knots=FloatArray.of(path.knots)).check()
    moving = path.knots.copy()
    moving[-1, 5] += 0.001
    with pytest.raises(InvalidMessageError, match="must be at rest"):
        Fly(knots=FloatArray.of(moving)).check()


@settings(max_examples=60)
@given(paths())
def test_velocities_and_accelerations_are_those_of_the_positions(path: FlightPath) -> None:
    times = np.arange(0.0, path.duration_s, STEP_S)
    samples = path.sample(times)
    inside = slice(3, -3)
    for value, rate in ((slice(0, 4), slice(4, 8)), (slice(4, 8), slice(8, 12))):
        difference = np.gradient(samples[:, value], STEP_S, axis=0)
        scale = 1.0 + np.abs(samples[:, 8:]).max()
        assert np.abs(difference - samples[:, rate])[inside].max() < 2e-2 * scale


@settings(max_examples=60)
@given(paths())
def test_a_path_begins_and_ends_at_rest_and_fits_into_a_request(path: FlightPath) -> None:
    ends = path.sample(np.array([-1.0, 0.0, path.duration_s, path.duration_s + 1.0]))
    assert np.abs(ends[:, 4:]).max() < 1e-6
    assert ends[0, :4] == pytest.approx(ends[1, :4])
    assert ends[2, :4] == pytest.approx(ends[3, :4])
    assert path.knots[0, 0] == 0.0
    assert (np.diff(path.knots[:, 0]) > 0).all()
    assert len(path.knots) < MAX_KNOTS


def test_a_circle_keeps_its_radius_and_its_speed() -> None:
    path = circle((0.1, -0.2, 1.0), 0.5, 8.0, turns=2.0, heading="center")
    samples = path.sample(np.arange(0.0, path.duration_s, 0.05))
    offset = samples[:, :2] - np.array([0.1, -0.2])
    assert np.hypot(*offset.T) == pytest.approx(0.5, abs=1e-4)
    assert np.linalg.norm(samples[:, 4:6], axis=1).max() == pytest.approx(math.tau * 0.5 / 8.0, rel=1e-3)
    towards = np.column_stack((np.cos(samples[:, 3]), np.sin(samples[:, 3])))
    assert (towards * -offset / 0.5).sum(axis=1) == pytest.approx(1.0, abs=1e-3)


def test_a_spiral_climbs_and_widens() -> None:
    path = spiral((0.0, 0.0, 0.8), (0.2, 0.6), 0.5, 6.0, turns=2.0)
    first, last = path.sample(np.array([0.0, path.duration_s]))
    assert first[:3] == pytest.approx((0.2, 0.0, 0.8), abs=1e-6)
    assert last[:3] == pytest.approx((0.6, 0.0, 1.3), abs=1e-6)


def test_waypoints_are_passed_at_their_times() -> None:
    rows = [(1.0, 0.0, 0.0, 1.0, 0.0), (3.0, 0.5, 0.2, 1.2, 0.5), (6.0, -0.5, 0.1, 1.0, 1.0)]
    path = through(rows)
    for time_s, *place in rows:
        assert path.sample(np.array([time_s - 1.0]))[0, :4] == pytest.approx(place, abs=1e-3)


@pytest.mark.parametrize(
    ("build", "reason"),
    [
        (lambda: circle((0, 0, 1), -1.0, 8.0), "radius_m must be above 0"),
        (lambda: circle((0, 0, 1), 0.5, 0.0), "period_s must be above 0"),
        (lambda: circle((0, 0, 1), 0.5, 8.0, turns=0.0), "turns: 0 is not from 0.1"),
        (
            lambda: circle((0, 0, 1), 0.5, 8.0, heading="up"),
            "heading: 'up' is not one of fixed",
        ),
        (lambda: through([(0, 0, 0, 1, 0)]), "at least two rows"),
        (lambda: through([(0, 0, 0, 1, 0), (0, 1, 0, 1, 0)]), "does not come after"),
        (lambda: through([(0, 0, 0, 1, 0), (math.nan, 1, 0, 1, 0)]), "finite"),
    ],
)
def test_what_is_no_path_is_refused_with_the_reason(build: object, reason: str) -> None:
    assert callable(build)
    with pytest.raises(PathError, match=reason):
        build()


def test_a_path_is_refused_where_it_asks_too_much() -> None:
    assert path_problem(circle((0, 0, 1), 0.6, 8.0), COAXIAL_LAG, 8.0) is None
    fast = path_problem(circle((0, 0, 1), 0.6, 1.5, turns=3.0), COAXIAL_LAG, 4.5)
    assert fast is not None
    assert "times as slow it could be flown" in fast


def test_flown_as_slow_as_the_refusal_says_it_is_accepted() -> None:
    fast = path_problem(circle((0, 0, 1), 0.6, 2.0, turns=2.0), COAXIAL_LAG, 4.0)
    assert fast is not None
    factor = float(fast.split("; ")[1].split(" ")[0])
    slow = circle((0, 0, 1), 0.6, 2.0 * (factor + 0.02), turns=2.0)
    assert path_problem(slow, COAXIAL_LAG, slow.duration_s) is None


@given(st.floats(-1.0, 1.0), st.floats(-0.4, 0.4), st.floats(-20.0, 20.0))
def test_the_way_to_the_beginning_starts_where_the_vehicle_is(x: float, speed: float, yaw: float) -> None:
    present = np.zeros(12)
    present[[0, 2, 3, 4]] = x, 1.0, yaw, speed
    path = circle((0, 0, 1), 0.5, 8.0)
    run_in_s = run_in_time_s(path, present)
    begun = begun_from(path, present, run_in_s)
    assert begun.sample(np.array([0.0]))[0] == pytest.approx(present)
    at_start = begun.sample(np.array([run_in_s]))[0]
    assert at_start[:3] == pytest.approx((0.5, 0.0, 1.0))
    assert math.remainder(float(at_start[3]), math.tau) == pytest.approx(0.0, abs=1e-9)
    assert abs(at_start[3] - yaw) <= math.pi + 1e-9


def test_the_whole_path_is_previewed_and_its_end_is_held() -> None:
    reference = PathReference(circle((0, 0, 1), 0.5, 4.0), start_s=10.0)
    preview = reference.sample(11.0, 0.02, 50)
    assert preview.samples[10] == pytest.approx(reference.path.sample(np.array([1.2]))[0])
    assert not reference.finished(12.0)
    assert reference.finished(10.0 + reference.path.duration_s)
    late = reference.sample(100.0, 0.02, 5)
    assert late.samples[0, :3] == pytest.approx((0.5, 0.0, 1.0), abs=1e-6)
    assert not late.samples[:, 4:].any()


def test_waypoints_turn_the_nearest_way_unless_headings_count_whole_turns() -> None:
    rows = [(t, 0.1 * t, 0.0, 1.0, math.radians(yaw)) for t, yaw in ((0, 170), (3, -170), (7, 170))]
    turned = through(rows).knots[:, 4]
    assert np.degrees(turned.max() - turned.min()) < 25.0
    assert turned[0] == pytest.approx(turned[-1])
    counted = through(rows, whole_turns=True).knots[:, 4]
    assert np.degrees(counted.max() - counted.min()) > 330.0
