"""Promises about leaders that are prepared for a frame, when several vehicles change at once."""

import pytest
from support.plans import plan_of
from support.request_handling import (
    UP,
    HandlerBench,
    follow_at,
)

from rcopterx.agents.following.leader_changes import PREPARED_S
from rcopterx.bus.messages import LeaderLink, SetPoint
from rcopterx.bus.requests import (
    CommitLeaders,
    Land,
    PrepareLeaders,
    WithdrawLeaders,
)
from rcopterx.vehicles.phases import Phase


@pytest.fixture
def bench() -> HandlerBench:
    return HandlerBench()


def prepare(*following: LeaderLink, place: tuple[float, float, float] | None = None) -> PrepareLeaders:
    set_point = None if place is None else SetPoint(position_m=place, yaw_rad=0.5)
    return PrepareLeaders(operation="swap_1", following=following, set_point=set_point)


BESIDE = LeaderLink(leader="h1", offset_m=(0.5, 0.0, 0.0))


def prepared(bench: HandlerBench, ancestors: tuple[str, ...] = ("h9",)) -> None:
    """A vehicle that leads is ready to follow its present follower."""
    bench.fly()
    asked = bench.ask(prepare(BESIDE))
    bench.plan_bus.deliver(plan_of("h1", bench.frame - 1, ancestors=ancestors))
    bench.changes.decide()
    assert asked.refusal is None


def test_prepared_leaders_are_taken_at_their_frame_and_not_before(bench: HandlerBench) -> None:
    prepared(bench)
    assert bench.ask(CommitLeaders(operation="swap_1", epoch=1, frame=12)).refusal is None
    for _ in range(2):
        bench.changes.apply_prepared()
        assert bench.pilot.guidance.task.followed == ()
        bench.see()
    assert bench.pilot.clock.current_frame == 12
    bench.changes.apply_prepared()
    assert [link.leader for link in bench.pilot.guidance.task.followed] == ["h1"]
    assert set(bench.leaders.plans(bench.pilot.clock, bench.changes.cycles_from)) == {"h1"}


def test_a_follower_that_shall_lead_keeps_the_place_it_is_given(bench: HandlerBench) -> None:
    bench.fly()
    follow_at(bench, (0.5, 0.0, 0.0))
    assert bench.ask(prepare(place=(0.2, 0.3, 1.1))).refusal is None
    assert bench.ask(CommitLeaders(operation="swap_1", epoch=1, frame=11)).refusal is None
    bench.see()
    bench.changes.apply_prepared()
    assert bench.pilot.guidance.task.followed == ()
    assert bench.plan_bus.open_names() == []
    position_m, yaw_rad = bench.pilot.guidance.set_point()
    assert (*position_m, yaw_rad) == pytest.approx((0.2, 0.3, 1.1, 0.5))


def test_a_vehicle_that_lands_meanwhile_goes_on_landing(bench: HandlerBench) -> None:
    bench.fly()
    follow_at(bench, (0.5, 0.0, 0.0))
    bench.ask(prepare(place=(0.2, 0.3, 1.1)))
    bench.ask(CommitLeaders(operation="swap_1", epoch=1, frame=11))
    assert bench.ask(Land()).refusal is None
    descent = bench.pilot.guidance.task.source
    bench.see()
    bench.changes.apply_prepared()
    assert bench.pilot.guidance.phase is Phase.LANDING
    assert bench.pilot.guidance.task.source is descent
    assert bench.pilot.events["regrouping_missed"] == 1


def test_withdrawn_leaders_are_never_taken(bench: HandlerBench) -> None:
    prepared(bench)
    bench.ask(CommitLeaders(operation="swap_1", epoch=1, frame=11))
    assert bench.ask(WithdrawLeaders(operation="swap_1")).refusal is None
    bench.see()
    bench.changes.apply_prepared()
    assert bench.pilot.guidance.task.followed == ()
    assert bench.plan_bus.open_names() == []


def test_prepared_leaders_are_forgotten_after_a_while_and_counted(bench: HandlerBench) -> None:
    prepared(bench)
    bench.clock.advance(PREPARED_S + 0.1)
    refusal = bench.ask(CommitLeaders(operation="swap_1", epoch=1, frame=99)).refusal
    assert refusal == "nothing is prepared under 'swap_1'"
    assert bench.pilot.events["regrouping_expired"] == 1


@pytest.mark.parametrize(
    ("operation", "epoch", "frame", "words"),
    [
        ("swap_2", 1, 99, "nothing is prepared under 'swap_2'"),
        ("swap_1", 2, 99, "the stream of frames is another one now: epoch 1, not 2"),
        ("swap_1", 1, 10, "frame 10 has passed, the present one is 10"),
    ],
)
def test_impossible_frames_are_refused(
    bench: HandlerBench, operation: str, epoch: int, frame: int, words: str
) -> None:
    prepared(bench)
    refusal = bench.ask(CommitLeaders(operation=operation, epoch=epoch, frame=frame)).refusal
    assert refusal == words


def test_only_one_change_at_a_time_is_prepared(bench: HandlerBench) -> None:
    prepared(bench)
    second = bench.ask(PrepareLeaders(operation="swap_2", following=(BESIDE,)))
    assert second.refusal == "another change of leaders is under way (swap_1)"


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (prepare(), "set_point: needed exactly where following is empty"),
        (prepare(BESIDE, place=UP), "set_point: needed exactly where following is empty"),
        (prepare(place=(3.0, 0.0, 1.0)), "x: 3 m is outside the flight volume -1.2 .. 1.2 m"),
        (prepare(LeaderLink(leader="h9")), "h9 cannot follow itself"),
    ],
)
def test_senseless_changes_are_refused_before_anything_is_prepared(
    bench: HandlerBench, request_: PrepareLeaders, words: str
) -> None:
    bench.fly()
    assert bench.ask(request_).refusal == words


def test_leaders_change_together_only_in_flight(bench: HandlerBench) -> None:
    bench.arm()
    refusal = bench.ask(prepare(BESIDE)).refusal
    assert refusal == "leaders change together only in flight, the phase is armed"
