"""Agents, a gateway that may be replaced, and a network that loses, duplicates and reorders messages.

Agents are `ControlLease`, gateways `CommandValidator` with its `Leases`: the classes that fly.
`World.actions` are all that can happen next; `explore` does everything in every order.
"""

import io
import pickle
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from rcopterx.agents.takeover import WARM_S, ControlLease
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.command_validator import CommandValidator
from rcopterx.transmitter_gateway.inputs import CommandInput

LIMITS = ArbiterLimits()
PAUSE_S = 0.1
"""Long enough for commands to be late and for a reservation to end."""
PERIOD_S = 0.02
PATIENCE_S = 2.0
"""Within this time some agent must command when all messages arrive."""
HOVER = (0.0, 0.0, 0.5, 0.0)


class Bid(NamedTuple):
    """Request of an agent for a lease."""

    agent: int
    take_over: bool


class Answer(NamedTuple):
    """Answer to a bid, as one agent receives it."""

    to: int
    agent: int
    number: int
    commanding: int


class Applied(NamedTuple):
    """Lease in force when a frame was written, as one agent receives it."""

    to: int
    commanding: int


class Sent(NamedTuple):
    """Command of an agent."""

    agent: int
    lease: int
    sequence: int


Message = Bid | Answer | Applied | Sent


class World:
    """Everything at one moment.

    `recorded` is what survives the gateway: its leases, recorded before an answer or a frame leaves it
    (`recorded_first`), or only later.
    """

    def __init__(self, take_over: bool, faults: int) -> None:
        self.now_s = 100.0
        self.agents = {1: ControlLease(1, False, self.now_s)}
        self.take_over, self.faults, self.recorded_first = take_over, faults, True
        self.gateway = CommandValidator(LIMITS, Counter())
        self.recorded = (0, 0)
        self.messages: tuple[Message, ...] = ()
        self.sequence = 0
        self.applied = 0
        """Newest lease that has commanded."""
        self.given: dict[int, int] = {}
        """Agents by lease."""

    # What can happen ----------------------------------------------------------------------------------

    def actions(self) -> Iterator[tuple[str, Callable[["World"], None]]]:
        """Everything that can happen next, by name."""
        yield "time passes", lambda w: w.wait(PAUSE_S)
        for agent in self.agents:
            yield f"agent {agent} acts", lambda w, agent=agent: w.act(agent)
        for message in self.messages:
            yield f"{message} arrives", lambda w, message=message: w.deliver(message)
        if 2 not in self.agents:
            yield "agent 2 starts", lambda w: w.start(2)
        if not self.faults:
            return
        for message in self.messages:
            yield f"{message} is lost", lambda w, message=message: w.fail(w.drop, message)
            yield f"{message} arrives, and later again", lambda w, message=message: w.fail(w.receive, message)
        for agent in self.agents:
            yield f"agent {agent} crashes", lambda w, agent=agent: w.fail(w.agents.pop, agent)
        yield "the gateway is replaced", lambda w: w.fail(w.replace)

    def wait(self, seconds: float) -> None:
        """Let time pass; the gateway writes a frame meanwhile."""
        self.now_s = round(self.now_s + seconds, 6)
        self.record()
        for to in self.agents:
            self.send(Applied(to, self.gateway.leases.commanding))

    def start(self, agent: int) -> None:
        """Start an agent that has watched the vehicle for long enough to take over."""
        self.agents[agent] = ControlLease(agent, self.take_over, self.now_s - WARM_S)

    def act(self, agent: int) -> None:
        """One turn of the loop of an agent: it bids if that is due, and commands if it may."""
        lease = self.agents[agent]
        if lease.lost:
            del self.agents[agent]
            return
        if lease.bid_due(self.now_s):
            self.send(Bid(agent, lease.takes_over(self.now_s, ready=True)))
        if lease.held and not any(isinstance(m, Sent) and m.agent == agent for m in self.messages):
            self.sequence += 1
            self.send(Sent(agent, lease.number, self.sequence))

    def fail(self, action: Callable[..., Any], *arguments: Any) -> None:
        """Let a fault happen."""
        self.faults -= 1
        action(*arguments)

    def replace(self) -> None:
        """Kill the gateway; the next one knows what was recorded."""
        self.gateway = CommandValidator(LIMITS, Counter())
        self.gateway.leases.resume(*self.recorded, self.now_s)

    # Messages -----------------------------------------------------------------------------------------

    def send(self, message: Message) -> None:
        """Put a message on the network; equal ones count once."""
        if message not in self.messages:
            self.messages = (*self.messages, message)

    def drop(self, message: Message) -> None:
        """Remove a message from the network."""
        self.messages = tuple(m for m in self.messages if m != message)

    def deliver(self, message: Message) -> None:
        """Let a message arrive."""
        self.drop(message)
        self.receive(message)

    def receive(self, message: Message) -> None:
        """Process a message; it may still be on the network."""
        match message:
            case Bid(agent, take_over):
                self._on_bid(agent, take_over)
            case Sent():
                self._on_command(message)
            case Answer(to, agent, number, commanding) if to in self.agents:
                self.agents[to].on_answer(agent, number, commanding, self.now_s)
            case Applied(to, commanding) if to in self.agents:
                self.agents[to].note_applied(commanding, self.now_s)

    def _on_bid(self, agent: int, take_over: bool) -> None:
        leases = self.gateway.leases
        fresh = self.gateway.fresh(self.now_s)
        number = leases.bid(agent, self.now_s, fresh=fresh, take_over=take_over)
        if number:
            assert self.given.setdefault(number, agent) == agent, f"lease {number} was given twice"
        if self.recorded_first:
            self.record()
        for to in self.agents:
            self.send(Answer(to, agent, number, leases.commanding))

    def _on_command(self, sent: Sent) -> None:
        command = CommandInput(sent.lease, 1, sent.sequence, 1, HOVER)
        rejection = self.gateway.consider(command, self.now_s, pose=None, flying=True)
        if rejection is None:
            assert sent.lease >= self.applied, f"lease {sent.lease} commands after {self.applied}"
            self.applied = sent.lease
        if rejection is None and self.recorded_first:
            self.record()

    def record(self) -> None:
        """Record what a successor must know."""
        self.recorded = (self.gateway.leases.commanding, self.gateway.leases.issued)

    # Promises -----------------------------------------------------------------------------------------

    def check(self) -> None:
        """Check that at most one agent holds the lease that commands."""
        commanding = self.gateway.leases.commanding
        holders = [name for name, lease in self.agents.items() if lease.held and lease.number == commanding]
        assert len(holders) <= 1, f"{holders} command at the same time"

    def settle(self) -> None:
        """Deliver every message in order from now on, until an agent commands."""
        accepted = self.sequence
        end_s = self.now_s + PATIENCE_S
        while self.now_s < end_s:
            for message in self.messages:
                self.deliver(message)
                stream = self.gateway.stream
                if stream is not None and stream.command.cause.sequence > accepted:
                    return
            for agent in tuple(self.agents):
                self.act(agent)
            if not self.agents:
                self.start(3)
            self.wait(PERIOD_S)
        raise AssertionError(f"no agent commands within {PATIENCE_S:g} s")


class BrokenPromiseError(AssertionError):
    """A promise was broken; the message is the way to it."""


def explore(world: World, depth: int) -> int:
    """Do everything in every order, breadth first; returns the number of different worlds.

    Raises `BrokenPromiseError` with the shortest way to a broken promise.
    """
    first = _frozen(world)
    ways: dict[bytes, tuple[str, ...]] = {first: ()}
    frontier = [first]
    for _ in range(depth):
        reached = []
        for state in frontier:
            for number, (name, _) in enumerate(_thawed(state).actions()):
                following, problem = _after(state, number)
                if problem is not None:
                    raise BrokenPromiseError("\n  ".join([*ways[state], name, problem]))
                if following not in ways:
                    ways[following] = (*ways[state], name)
                    reached.append(following)
        frontier = reached
    return len(ways)


def _after(state: bytes, number: int) -> tuple[bytes, str | None]:
    """State after an action, and what it breaks."""
    world = _thawed(state)
    try:
        _, action = list(world.actions())[number]
        action(world)
        world.check()
        following = _frozen(world)
        world.settle()
    except AssertionError as problem:
        return state, str(problem)
    return following, None


class _Pickler(pickle.Pickler):
    """Leaves out the limits, which are the same everywhere."""

    def persistent_id(self, obj: Any) -> str | None:
        return "limits" if obj is LIMITS else None


class _Unpickler(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Any:
        return LIMITS


def _frozen(world: World) -> bytes:
    buffer = io.BytesIO()
    _Pickler(buffer).dump(world)
    return buffer.getvalue()


def _thawed(state: bytes) -> World:
    world = _Unpickler(io.BytesIO(state)).load()
    assert isinstance(world, World)
    return world
