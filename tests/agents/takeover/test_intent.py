"""Promises about restarts: for any task and moment a successor continues the task of its predecessor."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.flight import still

from rcopterx.agents.flight.guidance import Guidance, Task
from rcopterx.agents.flight.timeline import FleetClock
from rcopterx.agents.takeover import intent_of, passed_s, task_of
from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.bus.codec import decode, encode
from rcopterx.bus.intent import Intent
from rcopterx.control.references.columns import COLUMNS, YAW
from rcopterx.control.references.paths import MAX_KNOTS, FlightPath, begun_from
from rcopterx.control.references.set_points import (
    PathReference,
    ProfileLimits,
    ReferenceSource,
    SetPointReference,
    SuspendedPath,
    smooth_move,
    smooth_way,
)
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.formation.law import FollowedLeader, FormationOffset, LeaderPlan
from rcopterx.vehicles.phases import Event, Phase

MODEL = {"delay_s": 0.05, "lag_s": (0.1, 0.1, 0.1, 0.05), "uncertainty": {"gain_factor": (1.3, 1.3, 1.3)}}
SETTINGS = {"horizon": 12, "position_weights": (1.0, 2.0)}
CONFIGURATION = Configuration("lqr", "kalman", SETTINGS, {}, MODEL)
UP = (0.1, 0.2, 1.0)
numbers = st.floats(-2.0, 2.0)
places = st.tuples(numbers, numbers, numbers).map(np.array)
headings = st.floats(-30.0, 30.0)
times = st.floats(0.0, 20.0)
durations = st.floats(0.5, 10.0)


@st.composite
def sources(draw: st.DrawFn) -> ReferenceSource:
    start_m, end_m, yaw_rad, begun_s = draw(places), draw(places), draw(headings), draw(times)
    present = np.zeros(COLUMNS)
    present[:3], present[YAW] = start_m, draw(headings)
    knots = np.array([[0.0, *present], [draw(durations), *end_m, yaw_rad, *np.zeros(8)]])
    limits = ProfileLimits(3 * (1.0,), 3 * (1.0,), 3 * (9.0,))
    way = smooth_way(limits, end_m, yaw_rad, SetPointReference(start_m, 0.0), begun_s)
    trajectory = PathReference(FlightPath(knots), begun_s)
    suspended = draw(st.sampled_from((trajectory, way))).suspended(begun_s + 0.1, begun_s + 0.4)
    return draw(
        st.sampled_from(
            [
                SetPointReference(end_m, yaw_rad),
                smooth_move(start_m, end_m, yaw_rad, begun_s, 1.0),
                trajectory,
                suspended or way,
                way,
            ]
        )
    )


@st.composite
def followed_leaders(draw: st.DrawFn) -> tuple[FollowedLeader, ...]:
    found = []
    for name in draw(st.lists(st.sampled_from(("h1", "h2", "h3")), unique=True)):
        frame = draw(st.sampled_from(("inertial", "heading")))
        target = FormationOffset(draw(places), draw(headings), frame)
        start = draw(st.none() | st.builds(FormationOffset, places, headings, st.just(frame)))
        found.append(FollowedLeader(name, target, draw(durations), start, draw(times), draw(durations)))
    return tuple(found)


@st.composite
def tasks(draw: st.DrawFn) -> Task:
    followed = draw(followed_leaders())
    assigned = tuple(FollowedLeader(link.leader, link.target, link.weight) for link in followed)
    joined = frozenset(link.leader for link in followed)
    phase = draw(st.sampled_from((Phase.FLYING, Phase.TAKEOFF, Phase.EMERGENCY)))
    interrupted = draw(st.sampled_from((None, Phase.TAKEOFF))) if phase is Phase.EMERGENCY else None
    home_m = draw(st.none() | st.tuples(numbers, numbers))
    return Task(phase, draw(sources()), followed, assigned, joined, draw(numbers), interrupted, home_m=home_m)


def clock_at(epoch: int, frame: int, time_s: float = 0.0) -> FleetClock:
    clock = FleetClock()
    clock.frames_until(epoch, frame, 0.02)
    clock.time_s = time_s
    return clock


def received_intent(task: Task, time_s: float) -> Intent:
    """The intent as a successor gets it over the bus."""
    message = intent_of(1, task, CONFIGURATION, None, clock_at(7, 100, time_s), 0.5)
    return decode(encode(message), Intent)


@given(tasks(), times, times, st.floats(0.0, 3.0))
def test_references_and_offsets_go_on_as_if_nothing_had_happened(
    task: Task, time_s: float, own_time_s: float, passed: float
) -> None:
    restored = task_of(received_intent(task, time_s), own_time_s, passed)
    before = task.source.sample(time_s + passed, 0.1, 80).samples
    after = restored.source.sample(own_time_s, 0.1, 80).samples
    assert after == pytest.approx(before, abs=1e-5)
    assert [link.leader for link in restored.followed] == [link.leader for link in task.followed]
    for old, new in zip(task.followed, restored.followed, strict=True):
        for later_s in (0.0, 0.3, 2.0, 11.0):
            was, is_now = old.offset_at(time_s + passed + later_s), new.offset_at(own_time_s + later_s)
            assert is_now.position_m == pytest.approx(was.position_m, abs=1e-6)
            assert is_now.yaw_rad == pytest.approx(was.yaw_rad, abs=1e-6)
            assert (is_now.frame, new.weight) == (was.frame, old.weight)
    assert (restored.phase, restored.joined, restored.floor_m) == (task.phase, task.joined, task.floor_m)
    assert restored.interrupted is task.interrupted
    assert restored.home_m == task.home_m
    if isinstance(task.source, SuspendedPath):
        assert isinstance(restored.source, SuspendedPath)
        assert restored.source.kind is task.source.kind
        assert restored.source.rest.knots == pytest.approx(task.source.rest.knots, abs=1e-5)


def plan(yaw_rad: float) -> LeaderPlan:
    samples = np.zeros((60, COLUMNS))
    samples[:, 2], samples[:, YAW] = 1.0, yaw_rad
    return LeaderPlan(Trajectory(samples, 0.02), 0.0)


@given(tasks(), times, times, headings)
def test_guidance_of_a_successor_asks_for_the_same_reference(
    task: Task, time_s: float, own_time_s: float, leader_yaw_rad: float
) -> None:
    plans = {link.leader: plan(leader_yaw_rad) for link in task.followed}
    references = []
    for restored, now_s in (
        (task, time_s),
        (task_of(received_intent(task, time_s), own_time_s, 0.0), own_time_s),
    ):
        guidance = Guidance()
        guidance.on_event(Event.RESUME, still(UP), 0.0)
        guidance.restore(restored, still(UP), now_s)
        references.append(guidance.references(plans, still(UP), now_s, 0.06, 0.02, 40).flown.samples)
    assert references[1] == pytest.approx(references[0], abs=1e-5)


@given(tasks())
def test_who_stands_in_for_a_lost_leader_is_decided_anew(task: Task) -> None:
    led = Task(task.phase, task.source, (), task.assigned, frozenset(), 0.0)
    restored = task_of(received_intent(led, 1.0), 1.0, 0.0)
    assert [link.leader for link in restored.followed] == [link.leader for link in task.assigned]
    assert restored.joined == frozenset()


def test_offsets_wait_for_the_first_plan_after_a_restart() -> None:
    target, start = FormationOffset(np.array([1.0, 0.0, 0.0])), FormationOffset(np.zeros(3))
    link = FollowedLeader("h1", target, 1.0, start, 0.0, 4.0)
    resting = FollowedLeader("h1", target)
    task = Task(
        Phase.FLYING, SetPointReference(np.array(UP), 0.0), (link,), (resting,), frozenset({"h1"}), 0.0
    )
    guidance = Guidance()
    guidance.on_event(Event.RESUME, still(UP), 0.0)
    guidance.restore(task, still(UP), 1.0)
    guidance.references({}, still(UP), 1.0, 0.0, 0.02, 10)
    guidance.references({"h1": plan(0.0)}, still(UP), 1.1, 0.0, 0.02, 10)
    assert guidance.task.followed == (link,)
    guidance.references({}, still(UP), 1.5, 0.0, 0.02, 10)
    guidance.references({"h1": plan(0.0)}, still(UP), 1.6, 0.0, 0.02, 10)
    assert guidance.task.followed[0].start_s == 1.6, "later a leader that was missing is joined anew"


def test_a_way_to_a_set_point_is_none_of_a_trajectory_after_a_restart() -> None:
    limits = ProfileLimits(3 * (1.0,), 3 * (1.0,), 3 * (9.0,))
    goal_m = np.array([1.0, 0.0, 1.0])
    way = smooth_way(limits, goal_m, 0.0, SetPointReference(np.array(UP), 0.0), 0.0)
    guidance = Guidance()
    guidance.on_event(Event.RESUME, still(UP), 0.0)
    task = Task(Phase.FLYING, way, (), (), frozenset(), 0.0)
    guidance.restore(task_of(received_intent(task, 0.1), 0.1, 0.0), still(UP), 0.1)
    assert guidance.path_left_s(0.1) == 0.0
    # The transmitter gateway holds the vehicle for a moment.
    guidance.on_event(Event.OVERRIDE, still(UP), 0.0)
    guidance.on_event(Event.ARM, still(UP), 0.2)
    assert guidance.set_point()[0] == pytest.approx(goal_m)
    assert not guidance.events["trajectory_given_up"]


def test_a_task_of_before_the_flight_is_not_flown() -> None:
    guidance = Guidance()
    guidance.on_event(Event.RESUME, still(UP), 0.0)
    task = Task(Phase.ARMED, SetPointReference(np.zeros(3), 0.0), (), (), frozenset(), 0.0)
    guidance.restore(task, still(UP), 1.0)
    assert guidance.set_point()[0] == pytest.approx(UP)


def test_a_landing_goes_on_where_it_was() -> None:
    descent = smooth_move(np.array(UP), np.array([0.1, 0.2, -0.3]), 0.0, 2.0, 0.4)
    task = Task(Phase.LANDING, descent, (), (), frozenset(), 0.0)
    guidance = Guidance()
    guidance.on_event(Event.RESUME, still(UP), 0.0)
    guidance.restore(task_of(received_intent(task, 4.0), 10.0, 0.5), still(UP), 10.0)
    assert guidance.phase is Phase.LANDING
    now = guidance.task.source.sample(10.0, 0.02, 10).samples
    assert now == pytest.approx(descent.sample(4.5, 0.02, 10).samples, abs=1e-9)


def test_settings_are_those_of_before() -> None:
    task = Task(Phase.FLYING, SetPointReference(np.zeros(3), 0.0), (), (), frozenset(), 0.0)
    assert Configuration.reported(received_intent(task, 0.0).flown_by) == CONFIGURATION


@pytest.mark.parametrize(("epoch", "expected_s"), [(7, 0.5), (8, 0.3)])
def test_time_is_counted_in_frames_and_across_streams_by_age(epoch: int, expected_s: float) -> None:
    task = Task(Phase.FLYING, SetPointReference(np.zeros(3), 0.0), (), (), frozenset(), 0.0)
    assert passed_s(received_intent(task, 0.0), 0.3, clock_at(epoch, 125)) == pytest.approx(expected_s)


def test_turns_are_part_of_the_set_point() -> None:
    task = Task(Phase.FLYING, SetPointReference(np.zeros(3), 3 * math.pi), (), (), frozenset(), 0.0)
    assert received_intent(task, 0.0).set_point.yaw_rad == pytest.approx(3 * math.pi)


def test_the_longest_path_with_its_way_to_it_is_an_intent_also_suspended() -> None:
    knots = np.zeros((MAX_KNOTS, 1 + COLUMNS))
    knots[:, 0], knots[:, 3] = 0.1 * np.arange(MAX_KNOTS), 1.0
    path = PathReference(begun_from(FlightPath(knots), np.zeros(COLUMNS), 2.0), 0.0)
    for source in (path, path.suspended(1.0, 1.4)):
        assert source is not None
        restored = task_of(received_intent(Task(Phase.FLYING, source), 1.0), 1.0, 0.0)
        assert restored.source.end()[0] == pytest.approx(source.end()[0])
