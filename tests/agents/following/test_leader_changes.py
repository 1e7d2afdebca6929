"""Promises about requests for other leaders: refused with the reason, or taken at one frame."""

import pytest
from support.plans import plan_of
from support.request_handling import (
    UP,
    Asked,
    HandlerBench,
    follow,
    follow_at,
    go_to,
    say,
)
from support.statuses import hovering

from rcopterx.agents.following.leader_changes import FIRST_PLAN_LIMIT_S
from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.requests import (
    Follow,
    Lead,
    Reply,
)


@pytest.fixture
def bench() -> HandlerBench:
    return HandlerBench()


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("h9",), "h9 cannot follow itself"),
        (("h1", "h9"), "h9 cannot follow itself"),
        (("h7",), "unknown vehicle 'h7', known are h1, h2, h9"),
        (("h1", "h1"), "a leader is named twice"),
    ],
)
def test_impossible_leaders_are_refused_at_once(
    bench: HandlerBench, names: tuple[str, ...], words: str
) -> None:
    bench.fly()
    assert bench.ask(follow(*names)).refusal == words
    assert bench.plan_bus.opened == []


def test_a_leader_without_a_plan_is_refused_after_a_moment_and_the_old_one_stays(bench: HandlerBench) -> None:
    bench.fly()
    bench.plan_bus.deliver(plan_of("h1"))
    first = bench.ask(follow("h1"))
    bench.plan_bus.deliver(plan_of("h1"))
    bench.changes.decide()
    assert first.refusal is None
    second = bench.ask(follow("h2"))
    bench.changes.decide()
    assert second.answers == []
    bench.clock.advance(FIRST_PLAN_LIMIT_S + 0.01)
    bench.changes.decide()
    assert second.refusal == "no plan from h2: its agent sends nothing"
    assert [link.leader for link in bench.pilot.guidance.task.followed] == ["h1"]
    assert bench.plan_bus.open_names() == ["h1"]


def test_following_begins_as_soon_as_the_plan_is_here(bench: HandlerBench) -> None:
    bench.fly()
    asked = bench.ask(follow("h1", "h2", transition_s=3.0))
    bench.plan_bus.deliver(plan_of("h1"))
    bench.changes.decide()
    assert asked.answers == []
    bench.plan_bus.deliver(plan_of("h2"))
    bench.changes.decide()
    assert asked.refusal is None
    assert [(link.leader, link.duration_s) for link in bench.pilot.guidance.task.followed] == [
        ("h1", 3.0),
        ("h2", 3.0),
    ]


def test_requests_that_wait_do_not_take_each_others_plans_away(bench: HandlerBench) -> None:
    bench.fly()
    first, second = bench.ask(follow("h1")), bench.ask(follow("h2"))
    bench.plan_bus.deliver(plan_of("h1"))
    bench.changes.decide()
    assert first.refusal is None
    bench.plan_bus.deliver(plan_of("h2"))
    bench.changes.decide()
    assert second.refusal is None
    assert bench.plan_bus.open_names() == ["h2"]


def test_a_request_that_waits_is_refused_once_a_later_one_is_accepted(bench: HandlerBench) -> None:
    bench.fly()
    first = bench.ask(follow("h1"))
    assert bench.ask(Lead()).refusal is None
    second, third = bench.ask(follow("h1")), bench.ask(follow("h2"))
    bench.plan_bus.deliver(plan_of("h2"))
    bench.changes.decide()
    assert third.refusal is None
    bench.plan_bus.deliver(plan_of("h1"))
    bench.changes.decide()
    assert first.refusal == second.refusal == "overtaken by another change of leaders"
    assert [link.leader for link in bench.pilot.guidance.task.followed] == ["h2"]
    assert bench.plan_bus.open_names() == ["h2"]


def test_a_promise_holds_if_a_later_request_is_refused(bench: HandlerBench) -> None:
    promised(bench, "h1")
    assert bench.ask(follow("h9")).refusal is not None
    later = bench.ask(Follow(following=(LeaderLink(leader="h2", offset_m=(3.0, 0.0, 0.0)),)))
    assert later.refusal is not None
    bench.plan_bus.deliver(plan_of("h1"))
    bench.changes.decide()
    assert [link.leader for link in bench.pilot.guidance.task.followed] == ["h1"]


def test_a_cycle_is_refused_with_the_line_that_leads_back(bench: HandlerBench) -> None:
    bench.fly()
    asked = bench.ask(follow("h1"))
    bench.plan_bus.deliver(plan_of("h1", ancestors=("h2", "h9")))
    bench.changes.decide()
    assert asked.refusal == "a cycle: h9 follows h1 follows h2 follows h9"
    assert bench.pilot.guidance.task.followed == ()
    assert bench.plan_bus.open_names() == []


def test_lead_forgets_the_leaders_and_their_plans(bench: HandlerBench) -> None:
    bench.fly()
    bench.ask(follow("h1"))
    bench.plan_bus.deliver(plan_of("h1"))
    bench.changes.decide()
    assert bench.ask(Lead()).refusal is None
    assert bench.pilot.guidance.task.followed == ()
    assert bench.plan_bus.open_names() == []


def test_an_accepted_leader_is_answered_with_the_line_of_ancestors(bench: HandlerBench) -> None:
    bench.fly()
    (answer,) = follow_at(bench, (0.5, 0.0, 0.0), plan_of("h1", ancestors=("h2",))).answers
    assert answer == Reply(accepted=True, reason="h9 follows h1 follows h2")


def test_several_leaders_are_answered_with_all_of_their_ancestors(bench: HandlerBench) -> None:
    bench.fly()
    asked = bench.ask(follow("h1", "h2"))
    bench.plan_bus.deliver(plan_of("h1", ancestors=("h7",)))
    bench.plan_bus.deliver(plan_of("h2", ancestors=("h7", "h8")))
    bench.changes.decide()
    (answer,) = asked.answers
    assert answer.reason == "h9 follows h1, h2, who follow h7, h8"


@pytest.mark.parametrize(
    ("offset_m", "words"),
    [
        ((0.0, 0.0, 0.2), "h9 and h1 would be 0.2 m apart, the minimum distance is 0.3 m"),
        ((1.3, 0.0, 0.0), "no place for h9: x: 1.3 m is outside the flight volume -1.2 .. 1.2 m"),
        ((0.5, 0.0, -1.1), "no place for h9: z: -0.1 m is outside the flight volume 0 .. 2 m"),
        ((0.5, 0.4, 0.0), "h9 and h2 would be 0.1 m apart, the minimum distance is 0.3 m"),
    ],
)
def test_offsets_that_lead_out_or_too_close_are_refused_and_nothing_changes(
    bench: HandlerBench, offset_m: tuple[float, float, float], words: str
) -> None:
    bench.fly()
    say(bench, "h1", hovering((0.0, 0.0, 1.0)))
    say(bench, "h2", hovering((0.5, 0.5, 1.0), LeaderLink(leader="h1", offset_m=(0.5, 0.5, 0.0))))
    assert follow_at(bench, offset_m).refusal == words
    assert bench.pilot.guidance.task.followed == ()
    assert bench.plan_bus.open_names() == []
    assert bench.pilot.guidance.set_point()[0] == pytest.approx(UP)


def test_an_offset_of_a_vehicle_whose_followers_would_leave_the_volume_is_refused(
    bench: HandlerBench,
) -> None:
    bench.fly()
    say(bench, "h1", hovering((0.0, 0.0, 1.0)))
    say(bench, "h2", hovering((0.5, 0.0, 1.0), LeaderLink(leader="h9", offset_m=(0.6, 0.0, 0.0))))
    words = "no place for h2: x: 1.4 m is outside the flight volume -1.2 .. 1.2 m"
    assert follow_at(bench, (0.8, 0.0, 0.0)).refusal == words
    assert follow_at(bench, (0.5, 0.0, 0.0)).refusal is None


@pytest.mark.parametrize(
    ("airborne", "phase", "words"),
    [
        (False, "armed", "h1 is on the floor, its phase is armed"),
        (True, "landing", "h1 is not in free flight, its phase is landing"),
    ],
)
def test_a_flying_vehicle_does_not_follow_one_that_is_landed_or_landing(
    bench: HandlerBench, airborne: bool, phase: str, words: str
) -> None:
    bench.fly()
    say(bench, "h1", hovering((0.0, 0.0, 0.0), phase=phase))
    plan = plan_of("h1", airborne=airborne, followable=False)
    assert follow_at(bench, (0.5, 0.0, 0.0), plan).refusal == words


def test_on_the_floor_leaders_that_stand_as_well_are_taken(bench: HandlerBench) -> None:
    bench.see((0.1, 0.2, 0.0))
    plan = plan_of("h1", airborne=False, followable=False)
    assert follow_at(bench, (0.5, 0.0, -0.1), plan).refusal is None


def test_an_absent_leader_is_told_from_one_that_sees_nothing(bench: HandlerBench) -> None:
    bench.fly()
    asked = bench.ask(follow("h1", "h2"))
    say(bench, "h2", hovering((0.0, 0.0, 0.0), phase="ground"))
    bench.clock.advance(FIRST_PLAN_LIMIT_S + 0.01)
    bench.changes.decide()
    words = "no plan from h1: its agent sends nothing; no plan from h2: its phase is ground"
    assert asked.refusal == words


def test_a_leader_that_fell_silent_is_not_followed_anew(bench: HandlerBench) -> None:
    bench.fly()
    assert follow_at(bench, (0.5, 0.0, 0.0)).refusal is None
    bench.clock.advance(1.0)
    asked = bench.ask(follow("h1"))
    bench.clock.advance(FIRST_PLAN_LIMIT_S + 0.01)
    bench.changes.decide()
    assert asked.refusal is not None
    assert "no plan from h1" in asked.refusal


def promised(bench: HandlerBench, *names: str) -> Asked:
    """A request that is answered by what the leaders said of themselves."""
    bench.fly()
    for number, name in enumerate(("h1", "h2")):
        say(bench, name, hovering((-0.4, 0.8 * number, 1.0)))
    asked = bench.ask(follow(*names))
    assert asked.refusal is None
    return asked


def test_a_leader_that_says_it_flies_is_accepted_before_its_first_plan(bench: HandlerBench) -> None:
    asked = promised(bench, "h1")
    assert asked.answers[0].reason == "h9 follows h1"
    assert bench.pilot.guidance.task.followed == ()
    bench.plan_bus.deliver(plan_of("h1"))
    assert bench.changes.decide()
    assert [link.leader for link in bench.pilot.guidance.task.followed] == ["h1"]
    assert len(asked.answers) == 1
    assert not bench.changes.decide()


def test_an_early_answer_names_the_line_of_ancestors(bench: HandlerBench) -> None:
    bench.fly()
    say(bench, "h1", hovering((-0.4, 0.8, 1.0)))
    behind = LeaderLink(leader="h1", offset_m=(0.0, -0.8, 0.0))
    say(bench, "h2", hovering((-0.4, 0.0, 1.0), behind))
    assert bench.ask(follow("h2")).answers[0].reason == "h9 follows h2 follows h1"


@pytest.mark.parametrize(("phase", "age_s"), [("landing", 0.0), ("armed", 0.0), ("flying", 0.4)])
def test_a_leader_that_does_not_fly_or_is_quiet_is_not_promised(
    bench: HandlerBench, phase: str, age_s: float
) -> None:
    bench.fly()
    say(bench, "h1", hovering((-0.4, 0.0, 1.0), phase=phase))
    bench.clock.advance(age_s)
    assert bench.ask(follow("h1")).answers == []


def test_an_offset_that_leads_out_is_refused_before_the_first_plan(bench: HandlerBench) -> None:
    bench.fly()
    say(bench, "h1", hovering((1.0, 0.0, 1.0)))
    assert "outside the flight volume" in (bench.ask(follow("h1")).refusal or "")
    assert bench.plan_bus.open_names() == []


def test_a_promised_leader_whose_plan_never_comes_is_counted_and_nothing_changes(bench: HandlerBench) -> None:
    promised(bench, "h1")
    bench.clock.advance(FIRST_PLAN_LIMIT_S + 0.01)
    bench.changes.decide()
    assert bench.pilot.events["promised_leader_missing"] == 1
    assert bench.pilot.guidance.task.followed == ()
    assert bench.plan_bus.open_names() == []


def test_the_last_word_counts_while_a_plan_is_on_its_way(bench: HandlerBench) -> None:
    promised(bench, "h1")
    assert bench.ask(go_to(0.1, 0.0, 1.0)).refusal == "it is about to follow h1"
    assert bench.ask(follow("h2")).refusal is None
    bench.plan_bus.deliver(plan_of("h1"))
    bench.plan_bus.deliver(plan_of("h2"))
    bench.changes.decide()
    assert [link.leader for link in bench.pilot.guidance.task.followed] == ["h2"]
    promised(bench, "h1")
    assert bench.ask(Lead()).refusal is None
    bench.plan_bus.deliver(plan_of("h1"))
    bench.changes.decide()
    assert bench.pilot.guidance.task.followed == ()
