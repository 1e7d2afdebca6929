"""Promises about requests for other leaders: refused with the reason, or taken at one frame."""

import pytest
from support.plans import plan_of
from support.request_handling import (
    UP,
    Asked,
    Office,
    follow,
    follow_at,
    go_to,
    say,
)
from support.statuses import hovering

from agents.following.regrouping import PREPARED_S
from agents.following.requests import FIRST_PLAN_LIMIT_S
from agents.phases import Phase
from bus.messages import LeaderLink, SetPoint
from bus.requests import (
    CommitLeaders,
    Land,
    Lead,
    PrepareLeaders,
    Reply,
    WithdrawLeaders,
)


@pytest.fixture
def office() -> Office:
    return Office()


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("h9",), "h9 cannot follow itself"),
        (("h1", "h9"), "h9 cannot follow itself"),
        (("h7",), "unknown vehicle 'h7', known are h1, h2, h9"),
        (("h1", "h1"), "a leader is named twice"),
    ],
)
def test_impossible_leaders_are_refused_at_once(office: Office, names: tuple[str, ...], words: str) -> None:
    office.fly()
    assert office.ask(follow(*names)).refusal == words
    assert office.plan_bus.opened == []


def test_a_leader_without_a_plan_is_refused_after_a_moment_and_the_old_one_stays(office: Office) -> None:
    office.fly()
    office.plan_bus.deliver(plan_of("h1"))
    first = office.ask(follow("h1"))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.leading.settle_waiting()
    assert first.refusal is None
    second = office.ask(follow("h2"))
    office.desk.leading.settle_waiting()
    assert second.answers == []
    office.clock.advance(FIRST_PLAN_LIMIT_S + 0.01)
    office.desk.leading.settle_waiting()
    assert second.refusal == "no plan from h2: nothing is heard from its agent"
    assert [link.leader for link in office.pilot.guidance.followed] == ["h1"]
    assert office.plan_bus.open_names() == ["h1"]


def test_following_begins_as_soon_as_the_plan_is_here(office: Office) -> None:
    office.fly()
    asked = office.ask(follow("h1", "h2", transition_s=3.0))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.leading.settle_waiting()
    assert asked.answers == []
    office.plan_bus.deliver(plan_of("h2"))
    office.desk.leading.settle_waiting()
    assert asked.refusal is None
    assert [(link.leader, link.duration_s) for link in office.pilot.guidance.followed] == [
        ("h1", 3.0),
        ("h2", 3.0),
    ]


def test_requests_that_wait_do_not_take_each_others_plans_away(office: Office) -> None:
    office.fly()
    first, second = office.ask(follow("h1")), office.ask(follow("h2"))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.leading.settle_waiting()
    assert first.refusal is None
    office.plan_bus.deliver(plan_of("h2"))
    office.desk.leading.settle_waiting()
    assert second.refusal is None
    assert office.plan_bus.open_names() == ["h2"]


def test_a_cycle_is_refused_with_the_line_that_leads_back(office: Office) -> None:
    office.fly()
    asked = office.ask(follow("h1"))
    office.plan_bus.deliver(plan_of("h1", ancestors=("h2", "h9")))
    office.desk.leading.settle_waiting()
    assert asked.refusal == "a cycle: h9 follows h1 follows h2 follows h9"
    assert office.pilot.guidance.followed == ()
    assert office.plan_bus.open_names() == []


def test_lead_forgets_the_leaders_and_their_plans(office: Office) -> None:
    office.fly()
    office.ask(follow("h1"))
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.leading.settle_waiting()
    assert office.ask(Lead()).refusal is None
    assert office.pilot.guidance.followed == ()
    assert office.plan_bus.open_names() == []


def test_an_accepted_leader_is_answered_with_the_line_of_ancestors(office: Office) -> None:
    office.fly()
    (answer,) = follow_at(office, (0.5, 0.0, 0.0), plan_of("h1", ancestors=("h2",))).answers
    assert answer == Reply(accepted=True, reason="h9 follows h1 follows h2")


def test_several_leaders_are_answered_with_all_of_their_ancestors(office: Office) -> None:
    office.fly()
    asked = office.ask(follow("h1", "h2"))
    office.plan_bus.deliver(plan_of("h1", ancestors=("h7",)))
    office.plan_bus.deliver(plan_of("h2", ancestors=("h7", "h8")))
    office.desk.leading.settle_waiting()
    (answer,) = asked.answers
    assert answer.reason == "h9 follows h1, h2, who follow h7, h8"


@pytest.mark.parametrize(
    ("offset_m", "words"),
    [
        ((0.0, 0.0, 0.2), "h9 and h1 would be 0.2 m apart, the minimum distance is 0.3 m"),
        ((1.3, 0.0, 0.0), "h9 would leave: x: 1.3 m is outside the flight volume -1.2 .. 1.2 m"),
        ((0.5, 0.0, -1.1), "h9 would leave: z: -0.1 m is outside the flight volume 0 .. 2 m"),
        ((0.5, 0.4, 0.0), "h9 and h2 would be 0.1 m apart, the minimum distance is 0.3 m"),
    ],
)
def test_offsets_that_lead_out_or_too_close_are_refused_and_nothing_changes(
    office: Office, offset_m: tuple[float, float, float], words: str
) -> None:
    office.fly()
    say(office, "h1", hovering((0.0, 0.0, 1.0)))
    say(office, "h2", hovering((0.5, 0.5, 1.0), LeaderLink(leader="h1", offset_m=(0.5, 0.5, 0.0))))
    assert follow_at(office, offset_m).refusal == words
    assert office.pilot.guidance.followed == ()
    assert office.plan_bus.open_names() == []
    assert office.pilot.guidance.set_point()[0] == pytest.approx(UP)


def test_an_offset_of_a_vehicle_whose_followers_would_leave_the_volume_is_refused(office: Office) -> None:
    office.fly()
    say(office, "h1", hovering((0.0, 0.0, 1.0)))
    say(office, "h2", hovering((0.5, 0.0, 1.0), LeaderLink(leader="h9", offset_m=(0.6, 0.0, 0.0))))
    words = "h2 would leave: x: 1.4 m is outside the flight volume -1.2 .. 1.2 m"
    assert follow_at(office, (0.8, 0.0, 0.0)).refusal == words
    assert follow_at(office, (0.5, 0.0, 0.0)).refusal is None


@pytest.mark.parametrize(
    ("airborne", "phase", "words"),
    [
        (False, "armed", "h1 is on the floor, its phase is armed"),
        (True, "landing", "h1 is not in free flight, its phase is landing"),
    ],
)
def test_a_flying_vehicle_does_not_follow_one_that_is_landed_or_landing(
    office: Office, airborne: bool, phase: str, words: str
) -> None:
    office.fly()
    say(office, "h1", hovering((0.0, 0.0, 0.0), phase=phase))
    plan = plan_of("h1", airborne=airborne, followable=False)
    assert follow_at(office, (0.5, 0.0, 0.0), plan).refusal == words


def test_on_the_floor_leaders_that_stand_as_well_are_taken(office: Office) -> None:
    office.see((0.1, 0.2, 0.0))
    plan = plan_of("h1", airborne=False, followable=False)
    assert follow_at(office, (0.5, 0.0, -0.1), plan).refusal is None


def test_an_absent_leader_is_told_from_one_that_sees_nothing(office: Office) -> None:
    office.fly()
    asked = office.ask(follow("h1", "h2"))
    say(office, "h2", hovering((0.0, 0.0, 0.0), phase="ground"))
    office.clock.advance(FIRST_PLAN_LIMIT_S + 0.01)
    office.desk.leading.settle_waiting()
    words = "no plan from h1: nothing is heard from its agent; no plan from h2: its phase is ground"
    assert asked.refusal == words


def test_a_leader_that_fell_silent_is_not_followed_anew(office: Office) -> None:
    office.fly()
    assert follow_at(office, (0.5, 0.0, 0.0)).refusal is None
    office.clock.advance(1.0)
    asked = office.ask(follow("h1"))
    office.clock.advance(FIRST_PLAN_LIMIT_S + 0.01)
    office.desk.leading.settle_waiting()
    assert asked.refusal is not None
    assert "no plan from h1" in asked.refusal


def promised(office: Office, *names: str) -> Asked:
    """A request that is answered by what the leaders said of themselves."""
    office.fly()
    for number, name in enumerate(("h1", "h2")):
        say(office, name, hovering((-0.4, 0.8 * number, 1.0)))
    asked = office.ask(follow(*names))
    assert asked.refusal is None
    return asked


def test_a_leader_that_says_it_flies_is_accepted_before_its_first_plan(office: Office) -> None:
    asked = promised(office, "h1")
    assert asked.answers[0].reason == "h9 follows h1"
    assert office.pilot.guidance.followed == ()
    office.plan_bus.deliver(plan_of("h1"))
    assert office.desk.leading.settle_waiting()
    assert [link.leader for link in office.pilot.guidance.followed] == ["h1"]
    assert len(asked.answers) == 1
    assert not office.desk.leading.settle_waiting()


def test_an_early_answer_names_the_line_of_ancestors(office: Office) -> None:
    office.fly()
    say(office, "h1", hovering((-0.4, 0.8, 1.0)))
    behind = LeaderLink(leader="h1", offset_m=(0.0, -0.8, 0.0))
    say(office, "h2", hovering((-0.4, 0.0, 1.0), behind))
    assert office.ask(follow("h2")).answers[0].reason == "h9 follows h2 follows h1"


@pytest.mark.parametrize(("phase", "age_s"), [("landing", 0.0), ("armed", 0.0), ("flying", 0.4)])
def test_a_leader_that_does_not_fly_or_is_quiet_is_not_promised(
    office: Office, phase: str, age_s: float
) -> None:
    office.fly()
    say(office, "h1", hovering((-0.4, 0.0, 1.0), phase=phase))
    office.clock.advance(age_s)
    assert office.ask(follow("h1")).answers == []


def test_an_offset_that_leads_out_is_refused_before_the_first_plan(office: Office) -> None:
    office.fly()
    say(office, "h1", hovering((1.0, 0.0, 1.0)))
    assert "outside the flight volume" in (office.ask(follow("h1")).refusal or "")
    assert office.plan_bus.open_names() == []


def test_a_promised_leader_whose_plan_never_comes_is_counted_and_nothing_changes(office: Office) -> None:
    promised(office, "h1")
    office.clock.advance(FIRST_PLAN_LIMIT_S + 0.01)
    office.desk.leading.settle_waiting()
    assert office.desk.leading.events["promised_leader_missing"] == 1
    assert office.pilot.guidance.followed == ()
    assert office.plan_bus.open_names() == []


def test_the_last_word_counts_while_a_plan_is_on_its_way(office: Office) -> None:
    promised(office, "h1")
    assert office.ask(go_to(0.1, 0.0, 1.0)).refusal == "it is about to follow h1"
    assert office.ask(follow("h2")).refusal is None
    office.plan_bus.deliver(plan_of("h1"))
    office.plan_bus.deliver(plan_of("h2"))
    office.desk.leading.settle_waiting()
    assert [link.leader for link in office.pilot.guidance.followed] == ["h2"]
    promised(office, "h1")
    assert office.ask(Lead()).refusal is None
    office.plan_bus.deliver(plan_of("h1"))
    office.desk.leading.settle_waiting()
    assert office.pilot.guidance.followed == ()


def prepare(*following: LeaderLink, place: tuple[float, float, float] | None = None) -> PrepareLeaders:
    set_point = None if place is None else SetPoint(position_m=place, yaw_rad=0.5)
    return PrepareLeaders(operation="swap_1", following=following, set_point=set_point)


BESIDE = LeaderLink(leader="h1", offset_m=(0.5, 0.0, 0.0))


def prepared(office: Office, ancestors: tuple[str, ...] = ("h9",)) -> None:
    """A vehicle that leads is ready to follow its present follower."""
    office.fly()
    asked = office.ask(prepare(BESIDE))
    office.plan_bus.deliver(plan_of("h1", office.frame - 1, ancestors=ancestors))
    office.desk.leading.settle_waiting()
    assert asked.refusal is None


def test_prepared_leaders_are_taken_at_their_frame_and_not_before(office: Office) -> None:
    prepared(office)
    assert office.ask(CommitLeaders(operation="swap_1", epoch=1, frame=12)).refusal is None
    for _ in range(2):
        office.desk.leading.begin_due()
        assert office.pilot.guidance.followed == ()
        office.see()
    assert office.pilot.clock.current_frame == 12
    office.desk.leading.begin_due()
    assert [link.leader for link in office.pilot.guidance.followed] == ["h1"]
    assert set(office.leaders.plans(office.pilot.clock, office.desk.leading.cycles_from_frame)) == {"h1"}


def test_a_follower_that_shall_lead_keeps_the_place_it_is_given(office: Office) -> None:
    office.fly()
    follow_at(office, (0.5, 0.0, 0.0))
    assert office.ask(prepare(place=(0.2, 0.3, 1.1))).refusal is None
    assert office.ask(CommitLeaders(operation="swap_1", epoch=1, frame=11)).refusal is None
    office.see()
    office.desk.leading.begin_due()
    assert office.pilot.guidance.followed == ()
    assert office.plan_bus.open_names() == []
    position_m, yaw_rad = office.pilot.guidance.set_point()
    assert (*position_m, yaw_rad) == pytest.approx((0.2, 0.3, 1.1, 0.5))


def test_a_vehicle_that_lands_meanwhile_goes_on_landing(office: Office) -> None:
    office.fly()
    follow_at(office, (0.5, 0.0, 0.0))
    office.ask(prepare(place=(0.2, 0.3, 1.1)))
    office.ask(CommitLeaders(operation="swap_1", epoch=1, frame=11))
    assert office.ask(Land()).refusal is None
    descent = office.pilot.guidance.source
    office.see()
    office.desk.leading.begin_due()
    assert office.pilot.guidance.phase is Phase.LANDING
    assert office.pilot.guidance.source is descent
    assert office.desk.leading.regrouping.events == {"regrouping_missed": 1}


def test_withdrawn_leaders_are_never_taken(office: Office) -> None:
    prepared(office)
    office.ask(CommitLeaders(operation="swap_1", epoch=1, frame=11))
    assert office.ask(WithdrawLeaders(operation="swap_1")).refusal is None
    office.see()
    office.desk.leading.begin_due()
    assert office.pilot.guidance.followed == ()
    assert office.plan_bus.open_names() == []


def test_prepared_leaders_are_forgotten_after_a_while_and_counted(office: Office) -> None:
    prepared(office)
    office.clock.advance(PREPARED_S + 0.1)
    refusal = office.ask(CommitLeaders(operation="swap_1", epoch=1, frame=99)).refusal
    assert refusal == "nothing is prepared under 'swap_1'"
    assert office.desk.leading.regrouping.events == {"regrouping_expired": 1}


@pytest.mark.parametrize(
    ("operation", "epoch", "frame", "words"),
    [
        ("swap_2", 1, 99, "nothing is prepared under 'swap_2'"),
        ("swap_1", 2, 99, "the stream of frames is another one now: epoch 1, not 2"),
        ("swap_1", 1, 10, "frame 10 has passed, the present one is 10"),
    ],
)
def test_impossible_frames_are_refused(
    office: Office, operation: str, epoch: int, frame: int, words: str
) -> None:
    prepared(office)
    refusal = office.ask(CommitLeaders(operation=operation, epoch=epoch, frame=frame)).refusal
    assert refusal == words


def test_only_one_change_at_a_time_is_prepared(office: Office) -> None:
    prepared(office)
    second = office.ask(PrepareLeaders(operation="swap_2", following=(BESIDE,)))
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
    office: Office, request_: PrepareLeaders, words: str
) -> None:
    office.fly()
    assert office.ask(request_).refusal == words


def test_leaders_change_together_only_in_flight(office: Office) -> None:
    office.arm()
    refusal = office.ask(prepare(BESIDE)).refusal
    assert refusal == "leaders change together only in flight, the phase is armed"
