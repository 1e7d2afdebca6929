"""Promises of the guidance of followers: joining, losing and leaving leaders without a jerk."""

import numpy as np
import pytest
from hypothesis import given, settings
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
    moving_leader,
    offset,
    reference,
    standing_leader,
)

from rcopterx.agents.flight.guidance import OFFSET_SPEED_M_S
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.formation.law import FollowedLeader, LeaderPlan


@settings(max_examples=20, deadline=None)
@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-9, 9), st.floats(-3, 3))
def test_a_follower_joins_from_where_it_is_without_a_jerk(
    x: float, y: float, yaw: float, leader: float
) -> None:
    here = still((x, y, 1.2), yaw)
    guidance = flying((FollowedLeader("h1", offset(-0.5, 0.2, 0.0, 0.4)),), here)
    plans = {"h1": standing_leader((0.0, 0.0, 1.0), leader)}
    first = reference(guidance, plans, 0.0, here)
    assert first.position_m[0] == pytest.approx([x, y, 1.2], abs=1e-9)
    assert first.yaw_rad[0] == pytest.approx(yaw, abs=1e-9)
    speeds = []
    for number in range(200):
        path = reference(guidance, plans, 5 * number * PERIOD_S, here)
        speeds.append(np.linalg.norm(path.velocity_m_s[0]))
    assert path.position_m[0] == pytest.approx([-0.5, 0.2, 1.0])
    assert np.cos(path.yaw_rad[0] - leader - 0.4) == pytest.approx(1.0)
    assert abs(path.yaw_rad[0] - yaw) <= np.pi + 1e-9
    assert max(speeds) <= OFFSET_SPEED_M_S + 1e-6


def test_a_follower_is_at_its_offset_from_the_moving_leader_once_it_has_joined() -> None:
    guidance = flying((FollowedLeader("h1", offset(-0.5)),))
    reference(guidance, {"h1": moving_leader(0.5)}, 0.0)
    path = reference(guidance, {"h1": moving_leader(0.5)}, 60.0)
    assert path.position_m[:, 0] == pytest.approx(-0.5 + 0.5 * PERIOD_S * np.arange(STAGES))
    assert path.velocity_m_s[:, 0] == pytest.approx(0.5)


def test_an_old_plan_is_read_further_on() -> None:
    guidance = flying((FollowedLeader("h1", offset(0.0)),))
    reference(guidance, {"h1": moving_leader(0.5)}, 0.0)
    path = reference(guidance, {"h1": moving_leader(0.5, ahead_s=0.06)}, 60.0, delay_s=0.04)
    assert path.position_m[0, 0] == pytest.approx(0.5 * 0.1)


def test_whole_turns_between_leader_and_follower_mean_nothing() -> None:
    turned = still((0.0, 0.0, 1.0), 6 * np.pi + 0.1)
    guidance = flying((FollowedLeader("h1", offset(0.0)),), turned)
    plans = {"h1": standing_leader((0.0, 0.0, 1.0), -4 * np.pi + 0.1)}
    for time_s in (0.0, 60.0):
        path = reference(guidance, plans, time_s, turned)
        assert path.yaw_rad == pytest.approx(6 * np.pi + 0.1)


@pytest.mark.parametrize(
    "plans",
    [
        {},
        {"h3": standing_leader((5.0, 5.0, 1.0))},
        {"h1": standing_leader((5.0, 5.0, 1.0), ahead_s=0.7)},
        {"h1": standing_leader((5.0, 5.0, 0.0), followable=False)},
    ],
)
def test_a_follower_without_a_usable_plan_holds_its_place_and_counts_it(plans: dict[str, LeaderPlan]) -> None:
    guidance = flying((FollowedLeader("h1", offset(-0.5)),))
    path = reference(guidance, plans)
    assert path.position_m == pytest.approx(np.tile(ALOFT.motion[:3], (STAGES, 1)))
    assert guidance.events["leader_plan_missing"] == 1


def test_a_follower_that_loses_its_leader_stays_and_joins_again_without_a_jerk() -> None:
    guidance = flying((FollowedLeader("h1", offset(-0.5)),))
    plans = {"h1": standing_leader((0.0, 0.0, 1.0))}
    reference(guidance, plans, 0.0)
    reference(guidance, plans, 60.0)
    held = reference(guidance, {}, 60.02, still((-0.5, 0.0, 1.0)))
    assert held.position_m == pytest.approx(np.tile([-0.5, 0.0, 1.0], (STAGES, 1)))
    drifted = still((-0.4, 0.1, 1.1))
    joined = reference(guidance, plans, 61.0, drifted)
    assert joined.position_m[0] == pytest.approx(drifted.motion[:3])


def test_a_follower_of_several_takes_the_weighted_mean_and_goes_on_with_those_it_hears() -> None:
    links = (FollowedLeader("h1", offset(-1.0), 3.0), FollowedLeader("h2", offset(1.0), 1.0))
    guidance = flying(links)
    plans = {"h1": standing_leader((0.0, 0.0, 1.0)), "h2": standing_leader((2.0, 0.0, 1.0))}
    reference(guidance, plans, 0.0)
    path = reference(guidance, plans, 60.0)
    assert path.position_m[-1] == pytest.approx([0.75 * -1.0 + 0.25 * 3.0, 0.0, 1.0])
    here = still((-0.1, 0.0, 1.0))
    first = reference(guidance, {"h1": plans["h1"]}, 60.02, here)
    assert first.position_m[0] == pytest.approx(here.motion[:3], abs=1e-6)
    alone = reference(guidance, {"h1": plans["h1"]}, 70.0)
    assert alone.position_m[-1] == pytest.approx([-1.0, 0.0, 1.0])


def test_lead_holds_the_place_and_forgets_the_leaders() -> None:
    guidance = flying((FollowedLeader("h1", offset(-0.5)),))
    guidance.lead(ALOFT)
    assert guidance.task.followed == ()
    assert not guidance.follows
    path = reference(guidance, {"h1": standing_leader((5.0, 5.0, 1.0))})
    assert path.position_m[-1] == pytest.approx(ALOFT.motion[:3])


def test_a_new_offset_is_reached_in_the_time_that_was_asked_for() -> None:
    guidance = flying((FollowedLeader("h1", offset(-0.5)),))
    plans = {"h1": standing_leader((0.7, 0.1, 1.0))}
    guidance.follow([FollowedLeader("h1", offset(0.5))], plans, ALOFT, 10.0, 4.0)
    begin = guidance.task.followed[0].offset_at(10.0).position_m
    assert begin == pytest.approx(ALOFT.motion[:3] - [0.7, 0.1, 1.0])
    middle = guidance.task.followed[0].offset_at(12.0).position_m
    assert middle == pytest.approx((begin + np.array([0.5, 0.0, 0.0])) / 2)
    assert guidance.task.followed[0].offset_at(14.0).position_m == pytest.approx([0.5, 0.0, 0.0])


def test_a_transition_of_no_time_is_there_at_once() -> None:
    guidance = flying()
    plans = {"h1": standing_leader((0.0, 0.0, 1.0))}
    guidance.follow([FollowedLeader("h1", offset(0.5))], plans, ALOFT, 10.0, 0.0)
    assert reference(guidance, plans, 10.0).position_m[0] == pytest.approx([0.5, 0.0, 1.0])


def test_a_vehicle_on_the_floor_may_be_told_to_follow_and_does_so_in_the_air() -> None:
    guidance = armed()
    guidance.follow([FollowedLeader("h1", offset(0.5))], {}, FLOOR, 0.0, None)
    assert guidance.task.followed[0].leader == "h1"
    assert not guidance.follows
    guidance.take_off(FLOOR, 1.0, 0.0)
    assert not guidance.follows
    reference(guidance, {}, 60.0)
    assert guidance.follows


def deviating(by_m: float, nominal_m: float = 0.0, yaw_rad: float = 0.0) -> LeaderPlan:
    """Leader whose plan is beside its nominal trajectory."""
    nominal = hold(np.array([nominal_m, 0.0, 1.0]), yaw_rad, PERIOD_S, STAGES)
    samples = nominal.samples.copy()
    samples[:, 0] += by_m
    return LeaderPlan(Trajectory(samples, PERIOD_S), 0.0, nominal=nominal)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_a_follower_copies_a_share_of_its_leaders_deviation(share: float) -> None:
    guidance = flying((FollowedLeader("h1", offset(0.2)),))
    guidance.deviation_share = share
    for time_s in (0.0, 99.0):
        found = guidance.references({"h1": deviating(0.1)}, ALOFT, time_s, 0.0, PERIOD_S, STAGES)
    assert found.flown.position_m[:, 0] == pytest.approx(0.2 + 0.1 * share)
    assert found.nominal.position_m[:, 0] == pytest.approx(0.2)


def test_of_a_leader_without_a_nominal_trajectory_the_plan_counts() -> None:
    guidance = flying((FollowedLeader("h1", offset(0.2)),))
    plan = LeaderPlan(deviating(0.1).trajectory, 0.0)
    for time_s in (0.0, 99.0):
        found = guidance.references({"h1": plan}, ALOFT, time_s, 0.0, PERIOD_S, STAGES)
    assert found.flown.position_m[:, 0] == pytest.approx(0.3)
    assert found.nominal.position_m[:, 0] == pytest.approx(0.3)


def test_the_nominal_trajectory_of_the_head_reaches_the_end_of_a_chain_unchanged() -> None:
    plan = deviating(0.1)
    for _ in range(20):
        guidance = flying((FollowedLeader("h1", offset(0.2)),))
        for time_s in (0.0, 99.0):
            found = guidance.references({"h1": plan}, ALOFT, time_s, 0.0, PERIOD_S, STAGES)
        plan = LeaderPlan(found.flown, 0.0, nominal=found.nominal)
    assert found.nominal.position_m[:, 0] == pytest.approx(20 * 0.2)
    assert found.flown.position_m[:, 0] == pytest.approx(20 * 0.2, abs=1e-6)


def test_plan_and_nominal_trajectory_count_the_same_turns() -> None:
    here = at((0.0, 0.0, 1.0), -3.1)
    guidance = flying((FollowedLeader("h1", offset(0.2, yaw_rad=3.1)),), here)
    plans = {"h1": deviating(0.1, yaw_rad=4 * np.pi)}
    for time_s in (0.0, 99.0):
        found = guidance.references(plans, here, time_s, 0.0, PERIOD_S, STAGES)
    assert found.nominal.yaw_rad == pytest.approx(found.flown.yaw_rad)


def test_another_leader_is_followed_from_the_own_place_without_a_jump() -> None:
    guidance = flying((FollowedLeader("h1", offset(0.2)),), at((0.2, 0.0, 1.0)))
    plans = {"h1": deviating(0.1), "h2": deviating(-0.1, 0.5)}
    guidance.references(plans, at((0.2, 0.0, 1.0)), 0.0, 0.0, PERIOD_S, STAGES)
    guidance.follow((FollowedLeader("h2", offset(0.2)),), plans, at((0.23, 0.0, 1.0)), 5.0, None)
    found = guidance.references(plans, at((0.23, 0.0, 1.0)), 5.0, 0.0, PERIOD_S, STAGES)
    assert found.flown.position_m[0, 0] == pytest.approx(0.23)
