"""Promises of the guidance: phases, refusals, take-off and landing, set points, and restarts."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.flight import still
from support.guidance import (
    ALOFT,
    FLOOR,
    PERIOD_S,
    STAGES,
    armed,
    at,
    flying,
    offset,
    reference,
)

from rcopterx.agents.flight.guidance import TAKE_OFF_SPEED_M_S, Guidance
from rcopterx.agents.flight.lift_off import FLOOR_TIME_S
from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.paths import FlightPath
from rcopterx.control.references.set_points import ProfileTransition, SetPointReference
from rcopterx.formation.law import FollowedLeader
from rcopterx.vehicles.phases import AIRBORNE, TRANSITIONS, Event, Phase, transition

events = st.sampled_from(list(Event))


@given(st.lists(events, max_size=30))
def test_the_rotor_never_turns_on_the_floor(history: list[Event]) -> None:
    guidance = Guidance()
    for event in history:
        before = guidance.phase
        guidance.on_event(event, ALOFT, 0.0)
        assert guidance.rotor_on == (guidance.phase in AIRBORNE)
        if before in (Phase.GROUND, Phase.ARMED) and guidance.rotor_on:
            assert event in (Event.TAKE_OFF, Event.RESUME)
        if event is Event.DISARM:
            assert guidance.phase is Phase.GROUND
            assert not guidance.rotor_on


@given(st.sampled_from(list(Phase)), events)
def test_phases_change_only_by_the_table(phase: Phase, event: Event) -> None:
    rows = [row for row in TRANSITIONS if phase in row.phases and row.event is event]
    assert rows == [row for row in (transition(phase, event),) if row is not None]


def test_every_phase_can_be_reached_and_left() -> None:
    assert {row.target for row in TRANSITIONS} == set(Phase)
    assert {phase for row in TRANSITIONS for phase in row.phases} == set(Phase)


@given(st.lists(st.one_of(events, st.sampled_from(["take_off", "land", "go_to", "lead"])), max_size=30))
def test_requests_are_refused_with_a_reason_exactly_in_the_wrong_phases(history: list[Event | str]) -> None:
    guidance = Guidance()
    for time_s, step in enumerate(history):
        phase = guidance.phase
        match step:
            case "take_off":
                refusal = guidance.take_off(FLOOR, 1.0, float(time_s))
                assert (refusal is None) == (phase is Phase.ARMED)
            case "land":
                refusal = guidance.land(ALOFT, float(time_s))
                assert (refusal is None) == (phase in AIRBORNE)
                assert refusal is not None or guidance.phase is Phase.LANDING
            case "go_to":
                refusal = guidance.go_to(guidance.way_to(np.ones(3), 0.0))
                assert (refusal is None) == (phase is Phase.FLYING)
            case "lead":
                guidance.lead(ALOFT)
                refusal = None
            case _:
                guidance.on_event(Event(step), ALOFT, 0.0)
                refusal = None
        if refusal is not None:
            assert str(phase) in refusal
            assert guidance.phase is phase
        assert np.isfinite(reference(guidance, time_s=float(time_s)).samples).all()


def test_take_off_climbs_straight_up_from_where_the_vehicle_stands() -> None:
    guidance = armed()
    assert guidance.take_off(FLOOR, 0.8, 5.0) is None
    assert guidance.phase is Phase.TAKEOFF
    path = guidance.task.source.sample(5.0, 0.01, 600)
    assert path.position_m[0] == pytest.approx(FLOOR.motion[:3])
    assert path.position_m[-1] == pytest.approx(FLOOR.motion[:3] + np.array([0, 0, 0.8]))
    assert np.ptp(path.position_m[:, :2], axis=0) == pytest.approx(0.0)
    assert (np.diff(path.position_m[:, 2]) >= 0).all()
    assert path.velocity_m_s[:, 2].max() == pytest.approx(TAKE_OFF_SPEED_M_S, rel=1e-3)


def test_take_off_ends_in_flight_once_the_climb_is_over() -> None:
    guidance = armed()
    guidance.take_off(FLOOR, 0.8, 5.0)
    reference(guidance, time_s=5.5)
    assert guidance.phase is Phase.TAKEOFF
    reference(guidance, time_s=20.0)
    assert guidance.phase is Phase.FLYING
    position_m, _ = guidance.set_point()
    assert position_m[2] == pytest.approx(0.85)


def land(guidance: Guidance, heights_m: np.ndarray, start_s: float = 0.0) -> list[float]:
    """Times at which the phase was left while the vehicle was at these heights, one per period."""
    left = []
    for number, (before_m, height_m) in enumerate(itertools.pairwise(heights_m)):
        time_s = start_s + number * PERIOD_S
        climb_m_s = (height_m - before_m) / PERIOD_S
        before = guidance.phase
        guidance.check_floor(at((0.0, 0.0, height_m), climb_m_s=climb_m_s), time_s)
        if guidance.phase is not before:
            left.append(time_s)
    return left


def test_landing_descends_where_the_vehicle_is_and_ends_on_the_floor_it_took_off_from() -> None:
    guidance = armed()
    guidance.take_off(FLOOR, 0.8, 0.0)
    reference(guidance, time_s=20.0)
    assert guidance.land(ALOFT, 20.0) is None
    path = guidance.task.source.sample(20.0, 0.01, 800)
    assert path.position_m[0] == pytest.approx(ALOFT.motion[:3])
    assert path.position_m[:, :2] == pytest.approx(np.tile(ALOFT.motion[:2], (800, 1)))
    assert path.yaw_rad == pytest.approx(0.3)
    assert path.position_m[-1, 2] < FLOOR.motion[2]
    descent = np.concatenate((np.linspace(1.0, 0.05, 150), np.full(60, 0.05)))
    (touchdown_s,) = land(guidance, descent, 20.0)
    assert touchdown_s == pytest.approx(20.0 + 150 * PERIOD_S + FLOOR_TIME_S, abs=0.05)
    assert guidance.phase is Phase.ARMED
    assert not guidance.rotor_on


def test_a_vehicle_that_passes_low_and_fast_has_not_landed() -> None:
    guidance = armed()
    guidance.take_off(FLOOR, 0.8, 0.0)
    guidance.land(at((0.2, 0.1, 0.3)), 0.5)
    path = guidance.task.source.sample(0.5, PERIOD_S, 500).position_m[:, 2]
    above = int(np.sum(path > FLOOR.motion[2]))
    bounces = 0.06 + 0.02 * np.sin(0.6 * np.arange(above))
    assert land(guidance, bounces, 0.5) == []


def test_a_vehicle_that_bounces_on_the_floor_has_landed_when_its_descent_ends_far_below() -> None:
    guidance = armed()
    guidance.take_off(FLOOR, 0.8, 0.0)
    guidance.land(at((0.2, 0.1, 0.3)), 0.5)
    path = guidance.task.source.sample(0.5, PERIOD_S, 500).position_m[:, 2]
    floor_m = FLOOR.motion[2]
    bounces = np.maximum(path, floor_m + np.abs(0.12 * np.sin(0.3 * np.arange(500))))
    (touchdown_s,) = land(guidance, bounces, 0.5)
    assert guidance.phase is Phase.ARMED
    assert path[round((touchdown_s - 0.5) / PERIOD_S) - 1] < floor_m - 0.05


def test_a_vehicle_that_goes_on_below_the_floor_it_took_off_from_has_not_landed_there() -> None:
    guidance = armed()
    guidance.take_off(FLOOR, 0.8, 0.0)
    guidance.land(at((0.9, 0.9, 0.8)), 0.5)
    path = guidance.task.source.sample(0.5, PERIOD_S, 500).position_m[:, 2]
    assert land(guidance, path[path > FLOOR.motion[2] - 0.25], 0.5) == []


def test_landing_asked_twice_goes_on() -> None:
    guidance = flying()
    guidance.land(ALOFT, 0.0)
    path = guidance.task.source
    assert guidance.land(at((0.0, 0.0, 0.5)), 1.0) is None
    assert guidance.task.source is path


def test_an_agent_that_restarted_in_flight_finds_a_floor_it_does_not_know() -> None:
    # Markers sit 12 cm above the floor, and only the process that died had seen the vehicle stand.
    guidance = flying()
    guidance.land(ALOFT, 0.0)
    path = guidance.task.source.sample(0.0, PERIOD_S, 500).position_m[:, 2]
    (touchdown_s,) = land(guidance, np.maximum(path, 0.12))
    assert guidance.phase is Phase.ARMED
    descent = guidance.task.source
    assert isinstance(descent, ProfileTransition)
    assert touchdown_s < descent.path.duration_s


def test_a_vehicle_in_the_air_that_follows_its_descent_has_not_landed() -> None:
    guidance = flying()
    guidance.land(ALOFT, 0.0)
    path = guidance.task.source.sample(0.0, PERIOD_S, 500).position_m[:, 2]
    lagging = np.concatenate((np.full(10, 1.0), path))
    assert land(guidance, lagging[lagging > 0.04]) == []


def test_resuming_and_recovering_hold_the_present_place() -> None:
    guidance = flying((FollowedLeader("h1", offset(1.0)),))
    assert reference(guidance).position_m == pytest.approx(np.tile(ALOFT.motion[:3], (STAGES, 1)))
    guidance.on_event(Event.OVERRIDE, ALOFT, 0.0)
    assert guidance.phase is Phase.EMERGENCY
    here = still((0.5, 0.5, 0.6), 1.0)
    guidance.on_event(Event.ARM, here, 0.0)
    assert reference(guidance, estimate=here).position_m[-1] == pytest.approx([0.5, 0.5, 0.6])


def held_and_given_back(guidance: Guidance, time_s: float) -> Estimate:
    """The transmitter gateway takes over and returns the vehicle, half a metre lower."""
    guidance.on_event(Event.OVERRIDE, ALOFT, 0.0)
    here = still((0.5, 0.5, 0.6), 1.0)
    guidance.on_event(Event.ARM, here, time_s)
    return here


def test_a_set_point_given_while_the_gateway_began_to_hold_is_flown_to_afterwards() -> None:
    guidance = flying()
    guidance.go_to(guidance.way_to(np.array([1.0, 1.0, 1.0]), 0.4))
    here = held_and_given_back(guidance, 5.0)
    assert reference(guidance, estimate=here).position_m[-1] == pytest.approx([1.0, 1.0, 1.0])
    assert guidance.set_point()[1] == pytest.approx(0.4)
    assert not guidance.remark


def test_a_trajectory_is_given_up_and_told_when_the_gateway_took_over() -> None:
    guidance = flying()
    guidance.fly(
        FlightPath(np.array([[0.0, *ALOFT.motion[:4], *8 * [0.0]], [9.0, 1, 1, 1, *9 * [0.0]]])), 0.0
    )
    here = held_and_given_back(guidance, 5.0)
    assert guidance.set_point()[0] == pytest.approx(here.motion[:3])
    assert guidance.events["trajectory_given_up"] == 1
    assert "trajectory is given up" in guidance.remark
    guidance.go_to(guidance.way_to(np.array([1.0, 1.0, 1.0]), 0.0))
    assert not guidance.remark


def test_the_end_of_a_trajectory_that_was_flown_is_kept_like_a_set_point() -> None:
    guidance = flying()
    guidance.fly(
        FlightPath(np.array([[0.0, *ALOFT.motion[:4], *8 * [0.0]], [9.0, 1, 1, 1, *9 * [0.0]]])), 0.0
    )
    held_and_given_back(guidance, 9.5)
    assert guidance.set_point()[0] == pytest.approx([1.0, 1.0, 1.0])
    assert not guidance.events["trajectory_given_up"]


def test_a_follower_takes_no_set_point_and_says_whose_to_ask_for() -> None:
    guidance = flying((FollowedLeader("h1", offset(1.0)),))
    refusal = guidance.go_to(guidance.way_to(np.zeros(3), 0.0))
    assert refusal is not None
    assert "h1" in refusal


def test_the_set_point_is_where_the_own_reference_ends() -> None:
    guidance = flying()
    guidance.task.source = SetPointReference(np.array([1.0, 2.0, 3.0]), 3 * np.pi)
    position_m, yaw_rad = guidance.set_point()
    assert position_m == pytest.approx([1.0, 2.0, 3.0])
    assert yaw_rad == pytest.approx(3 * np.pi)


def interrupted_climb() -> tuple[Guidance, np.ndarray]:
    guidance = Guidance()
    guidance.on_event(Event.ARM, FLOOR, 0.0)
    guidance.take_off(FLOOR, 1.0, 0.0)
    return guidance, guidance.set_point()[0]


@pytest.mark.parametrize("held_before", [False, True])
def test_a_successor_goes_on_with_a_climb_that_the_gateway_interrupts_again(held_before: bool) -> None:
    """Commands are late while an agent is replaced, so the gateway holds the vehicle."""
    guidance, end_m = interrupted_climb()
    if held_before:
        guidance.on_event(Event.OVERRIDE, ALOFT, 0.0)
    halfway = at((0.2, 0.1, 0.5), climb_m_s=0.3)
    successor = flying(estimate=halfway)
    successor.restore(guidance.task, halfway, 3.0)
    assert successor.phase is Phase.TAKEOFF
    for event in (Event.OVERRIDE, Event.ARM):
        successor.on_event(event, halfway, 3.1)
    assert successor.phase is Phase.TAKEOFF
    assert successor.set_point()[0] == pytest.approx(end_m)
    assert not successor.followable


def test_a_successor_lands_a_vehicle_whose_landing_was_interrupted() -> None:
    guidance = flying()
    guidance.land(ALOFT, 0.0)
    guidance.on_event(Event.OVERRIDE, ALOFT, 0.0)
    successor = flying()
    successor.restore(guidance.task, ALOFT, 3.0)
    assert successor.phase is Phase.LANDING
