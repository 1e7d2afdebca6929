"""When an agent asks for a control lease, and what it makes of the answers."""

import math

import pytest

from rcopterx.agents.takeover import (
    BID_PERIOD_S,
    EAGER_S,
    IGNORED_S,
    LATER_BID_PERIOD_S,
    REFUSED_S,
    WARM_S,
    ControlLease,
)

AGENT, OTHER = 7, 8


def lease_of(take_over: bool = False) -> ControlLease:
    return ControlLease(AGENT, take_over, now_s=0.0)


def holding() -> ControlLease:
    lease = lease_of()
    lease.on_answer(AGENT, 3, commanding=2, now_s=0.01)
    return lease


def test_an_agent_asks_at_once_and_until_it_is_answered() -> None:
    lease = lease_of()
    assert lease.bid_due(0.0)
    assert not lease.bid_due(BID_PERIOD_S / 2)
    assert lease.next_s() == BID_PERIOD_S
    assert lease.bid_due(BID_PERIOD_S)
    lease.on_answer(AGENT, 1, commanding=0, now_s=0.02)
    assert lease.held
    assert not lease.quiet
    assert not lease.bid_due(1.0)
    assert lease.next_s() == math.inf


def test_without_an_answer_an_agent_speaks_for_its_vehicle_and_asks_less_often_after_a_while() -> None:
    lease = lease_of()
    assert lease.bid_due(EAGER_S)
    assert not lease.quiet
    assert lease.next_s() == EAGER_S + LATER_BID_PERIOD_S


def test_answers_to_others_give_no_lease() -> None:
    lease = lease_of()
    lease.on_answer(OTHER, 1, commanding=0, now_s=0.01)
    assert not lease.held


@pytest.mark.parametrize("source", ["answer", "frame"])
def test_an_agent_has_lost_as_soon_as_a_later_lease_commands(source: str) -> None:
    lease = holding()
    lease.note_applied(3, 0.02)
    assert lease.held
    if source == "answer":
        lease.on_answer(OTHER, 4, commanding=4, now_s=0.03)
    else:
        lease.note_applied(4, 0.03)
    assert lease.lost
    assert lease.quiet
    assert not lease.held
    assert not lease.bid_due(10.0)


def test_a_later_lease_that_does_not_command_yet_changes_nothing() -> None:
    lease = holding()
    lease.on_answer(OTHER, 4, commanding=3, now_s=0.03)
    assert lease.held


def test_an_agent_whose_vehicle_another_one_flies_keeps_quiet_and_gives_up() -> None:
    lease = lease_of()
    lease.on_answer(AGENT, 0, commanding=2, now_s=0.01)
    assert lease.quiet
    assert not lease.lost
    lease.on_answer(AGENT, 0, commanding=2, now_s=0.01 + REFUSED_S)
    assert lease.lost


def test_a_refusal_that_arrives_late_takes_no_lease_away() -> None:
    lease = holding()
    lease.on_answer(AGENT, 0, commanding=2, now_s=0.02)
    lease.on_answer(AGENT, 0, commanding=2, now_s=5.0)
    assert lease.held


def test_an_agent_that_is_to_take_over_does_so_when_it_is_warm_and_waits_until_then() -> None:
    lease = lease_of(take_over=True)
    assert lease.quiet
    assert lease.bid_due(0.0)
    assert not lease.takes_over(WARM_S - 0.01, ready=True)
    assert not lease.takes_over(WARM_S, ready=False)
    assert lease.takes_over(WARM_S, ready=True)
    for now_s in (0.01, 5.0):
        lease.on_answer(AGENT, 0, commanding=2, now_s=now_s)
    assert not lease.lost
    assert not lease_of().takes_over(WARM_S, ready=True)


def test_an_agent_whose_lease_the_gateway_has_forgotten_asks_for_another_one() -> None:
    lease = holding()
    lease.note_applied(0, 1.0)
    assert not lease.bid_due(1.0 + IGNORED_S / 2)
    lease.note_applied(0, 1.0 + IGNORED_S)
    assert lease.bid_due(1.0 + IGNORED_S)
    lease.on_answer(AGENT, 1, commanding=0, now_s=1.4)
    assert (lease.number, lease.held) == (1, True)
    assert not lease.bid_due(2.0)
