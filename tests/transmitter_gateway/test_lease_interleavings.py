"""Leases and take-over in every order of messages, losses, duplicates, crashes and replaced gateways."""

from collections.abc import Callable

import pytest
from lease_model import Bid, BrokenPromiseError, Sent, World, explore

from rcopterx.transmitter_gateway.command_validator import Leases

FAULTS = 2


def starting(take_over: bool) -> World:
    """Two agents have just sent their first bids."""
    world = World(take_over, FAULTS)
    world.start(2)
    world.act(1)
    world.act(2)
    return world


def commanded(take_over: bool) -> World:
    """Agent 1 flies, and a command of it is delayed; agent 2 has started."""
    world = World(take_over, FAULTS)
    world.settle()
    world.act(1)
    world.start(2)
    return world


def taking_over(take_over: bool) -> World:
    """Agent 2 has a lease and has sent its first command; one of agent 1 is delayed."""
    world = commanded(take_over)
    if not take_over:
        world.wait(1.0)
    world.act(2)
    for wanted in (Bid, tuple):
        for message in world.messages:
            if isinstance(message, wanted) and not isinstance(message, Sent):
                world.deliver(message)
    world.act(2)
    assert {message.agent for message in world.messages if isinstance(message, Sent)} == {1, 2}
    return world


WORLDS = (starting, commanded, taking_over)


@pytest.mark.parametrize("take_over", [True, False])
@pytest.mark.parametrize("begin", WORLDS)
def test_newest_lease_alone_commands_and_some_agent_commands_again(
    begin: Callable[[bool], World], take_over: bool
) -> None:
    assert explore(begin(take_over), 4) > 500


@pytest.mark.campaign
@pytest.mark.timeout(600)
@pytest.mark.parametrize("take_over", [True, False])
@pytest.mark.parametrize("begin", WORLDS)
def test_longer_histories_of_leases(begin: Callable[[bool], World], take_over: bool) -> None:
    assert explore(begin(take_over), 6) > 5000


@pytest.mark.parametrize(
    ("begin", "problem"),
    [(taking_over, "lease 1 commands after 2"), (starting, r"lease \d+ was given twice")],
)
def test_gateway_that_records_a_lease_too_late_is_found_out(
    begin: Callable[[bool], World], problem: str
) -> None:
    world = begin(True)
    world.recorded_first = False
    with pytest.raises(BrokenPromiseError, match=f"(?s)the gateway is replaced.*{problem}"):
        explore(world, 3)


def test_gateway_that_accepts_commands_of_older_leases_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Leases, "lost", lambda self, lease: False)
    with pytest.raises(BrokenPromiseError, match="lease 1 commands after 2"):
        explore(taking_over(True), 2)


def test_agents_that_never_bid_again_are_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rcopterx.agents.takeover.BID_PERIOD_S", 10.0)
    with pytest.raises(BrokenPromiseError, match="no agent commands within 2 s"):
        explore(starting(False), 3)
