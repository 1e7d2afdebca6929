"""Promises of following: plans are aligned by frame, other epochs and cycles are left out and counted."""

import pytest
from support.plans import PlanBus, plan_of

from rcopterx.agents.flight.timeline import FleetClock
from rcopterx.agents.following.leader_plans import LeaderPlans


@pytest.fixture
def plan_bus() -> PlanBus:
    return PlanBus()


@pytest.fixture
def leaders(plan_bus: PlanBus) -> LeaderPlans:
    leaders = LeaderPlans("h9", plan_bus.subscribe)  # type: ignore[arg-type]  # an inbox without a bus
    plan_bus.delivered = leaders.receive
    return leaders


def clock_at(frame: int, epoch: int = 1, coasted: int = 0) -> FleetClock:
    clock = FleetClock()
    clock.frames_until(epoch, frame - coasted, 0.02)
    for _ in range(coasted):
        clock.coast()
    return clock


def test_exactly_the_wanted_plans_are_subscribed_to(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1", "h2"])
    first = {inbox.name: inbox for inbox in plan_bus.opened}
    leaders.subscribe_to(["h2", "h3"])
    assert plan_bus.open_names() == ["h2", "h3"]
    assert first["h1"].closed
    assert [inbox.name for inbox in plan_bus.opened].count("h2") == 1
    leaders.subscribe_to([])
    assert plan_bus.open_names() == []


@pytest.mark.parametrize(
    ("plan_frame", "start_s", "ahead_s"),
    [(10, 0.02, -0.02), (9, 0.02, 0.0), (10, 0.0, 0.0), (7, 0.02, 0.04), (11, 0.02, -0.04)],
)
def test_plans_are_aligned_by_the_difference_of_frames_and_their_own_delay(
    leaders: LeaderPlans, plan_bus: PlanBus, plan_frame: int, start_s: float, ahead_s: float
) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.deliver(plan_of("h1", plan_frame, start_s=start_s, position_m=(1.0, 2.0, 3.0)))
    plan = leaders.plans(clock_at(10))["h1"]
    assert plan.ahead_s == pytest.approx(ahead_s)
    assert plan.trajectory.position_m[0] == pytest.approx([1.0, 2.0, 3.0])
    assert plan.trajectory.period_s == 0.02
    assert plan.followable


def test_a_nominal_trajectory_comes_with_its_plan(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1", "h3"])
    plan_bus.deliver(plan_of("h1", 10))
    plan_bus.deliver(plan_of("h3", 10, nominal_stages=20))
    plans = leaders.plans(clock_at(10))
    assert plans["h1"].nominal is None
    nominal = plans["h3"].nominal
    assert nominal is not None
    assert nominal.position_m == pytest.approx(0.0)


def test_a_nominal_trajectory_of_other_stages_is_refused(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.deliver(plan_of("h1", 10, nominal_stages=19))
    assert leaders.newest("h1") is None
    assert sum(leaders.rejected.values()) == 1


def test_frames_that_were_coasted_count(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.deliver(plan_of("h1", 10, start_s=0.0))
    assert leaders.plans(clock_at(13, coasted=3))["h1"].ahead_s == pytest.approx(0.06)


def test_plans_of_another_epoch_are_left_out_and_counted(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1", "h2"])
    plan_bus.deliver(plan_of("h1", epoch=7))
    plan_bus.deliver(plan_of("h2"))
    assert set(leaders.plans(clock_at(10))) == {"h2"}
    assert leaders.rejected == {"plan.epoch": 1}


def test_a_leader_on_the_floor_says_so(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.deliver(plan_of("h1", airborne=False))
    assert not leaders.plans(clock_at(10))["h1"].followable


def test_plans_are_complete_when_those_of_every_leader_belong_to_this_frame_or_later_ones(
    leaders: LeaderPlans, plan_bus: PlanBus
) -> None:
    epoch = clock_at(10).epoch
    assert leaders.complete(epoch, 10, plan_bus.open_names())
    leaders.subscribe_to(["h1", "h2"])
    assert not leaders.complete(epoch, 10, plan_bus.open_names())
    plan_bus.deliver(plan_of("h1", 10))
    assert not leaders.complete(epoch, 10, plan_bus.open_names())
    plan_bus.deliver(plan_of("h2", 9))
    assert not leaders.complete(epoch, 10, plan_bus.open_names())
    assert leaders.complete(epoch, 9, plan_bus.open_names())
    plan_bus.deliver(plan_of("h2", 10))
    assert leaders.complete(epoch, 10, plan_bus.open_names())
    assert not leaders.complete(epoch, 11, ["h1", "h2"])
    assert not leaders.complete(epoch + 1, 1, ["h1", "h2"])


def test_ancestors_are_the_leaders_and_theirs_nearest_first_each_once(
    leaders: LeaderPlans, plan_bus: PlanBus
) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.deliver(plan_of("h1", ancestors=("h2", "h3")))
    assert leaders.ancestors(["h1"]) == ("h1", "h2", "h3")
    leaders.subscribe_to(["h1", "h4"])
    plan_bus.deliver(plan_of("h4", ancestors=("h3", "h5")))
    assert set(leaders.ancestors(["h1", "h4"])) == {"h1", "h2", "h3", "h4", "h5"}
    assert len(leaders.ancestors(["h1", "h4"])) == 5
    assert leaders.ancestors(["h4"]) == ("h4", "h3", "h5")


def test_a_line_that_leads_back_is_found(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1"])
    assert leaders.cycle_through("h1") is None
    plan_bus.deliver(plan_of("h1", ancestors=("h2", "h9", "h3")))
    assert leaders.cycle_through("h1") == ("h1", "h2", "h9")
    assert leaders.cycle_through("h9") == ("h9",)
    plan_bus.deliver(plan_of("h1", ancestors=("h2", "h3")))
    assert leaders.cycle_through("h1") is None


def test_plans_of_a_cycle_that_began_unnoticed_are_left_out_and_counted(
    leaders: LeaderPlans, plan_bus: PlanBus
) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.deliver(plan_of("h1", ancestors=("h9",)))
    assert leaders.plans(clock_at(10)) == {}
    assert leaders.rejected == {"plan.leader_cycle": 1}


def test_refused_plans_stay_counted_after_the_leader_has_changed(
    leaders: LeaderPlans, plan_bus: PlanBus
) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.opened[0].store(b"garbage", 0.0)
    leaders.receive()
    assert leaders.newest("h1") is None
    leaders.subscribe_to(["h2"])
    plan_bus.opened[1].store(b"garbage", 0.0)
    leaders.receive()
    assert leaders.newest("h2") is None
    (count,) = leaders.rejected.values()
    assert count == 2


def test_the_age_is_that_of_the_oldest_plan_and_unknown_while_one_is_missing(
    leaders: LeaderPlans, plan_bus: PlanBus
) -> None:
    assert leaders.plan_age_s(100.0, []) is None
    leaders.subscribe_to(["h1", "h2"])
    plan_bus.deliver(plan_of("h1"), 99.0)
    assert leaders.plan_age_s(100.0, ["h1", "h2"]) is None
    plan_bus.deliver(plan_of("h2"), 99.5)
    assert leaders.plan_age_s(100.0, ["h1", "h2"]) == pytest.approx(1.0)
    assert leaders.newest("h7") is None


def test_a_leader_that_takes_off_or_lands_is_not_flown_by(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.deliver(plan_of("h1", followable=False))
    assert not leaders.plans(clock_at(10))["h1"].followable


def test_plans_of_frames_before_a_change_of_leaders_may_tell_of_the_old_line(
    leaders: LeaderPlans, plan_bus: PlanBus
) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.deliver(plan_of("h1", 10, ancestors=("h9",)))
    clock = clock_at(11)
    assert set(leaders.plans(clock, cycles_from=(clock.epoch, 11))) == {"h1"}
    assert leaders.plans(clock, cycles_from=(clock.epoch, 10)) == {}


def test_a_cycle_is_noticed_at_once_in_a_new_epoch_whose_frames_begin_anew(
    leaders: LeaderPlans, plan_bus: PlanBus
) -> None:
    leaders.subscribe_to(["h1"])
    plan_bus.deliver(plan_of("h1", 10, ancestors=("h9",)))
    clock = clock_at(11)
    assert leaders.plans(clock, cycles_from=(clock.epoch - 1, 5000)) == {}


def test_the_level_is_that_of_the_longest_line_of_leaders(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1", "h2"])
    assert leaders.level([]) == 0
    assert leaders.level(["h1", "h2"]) == 1
    plan_bus.deliver(plan_of("h2", 10, ancestors=("h4", "h5")))
    assert leaders.level(["h1", "h2"]) == 3
    assert leaders.level(["h1"]) == 1


def test_a_silent_leader_has_no_fresh_plan(leaders: LeaderPlans, plan_bus: PlanBus) -> None:
    leaders.subscribe_to(["h1"])
    assert leaders.fresh("h1", 100.0) is None
    plan_bus.deliver(plan_of("h1"), 100.0)
    assert leaders.fresh("h1", 100.05) is not None
    assert leaders.fresh("h1", 101.0) is None
    assert leaders.newest("h1") is not None
