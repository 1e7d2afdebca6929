"""A transmitter gateway as a program, from its start to its end, in virtual time."""

import select
import signal
import threading
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from gateway_bench import NAMES, Laboratory, OwnBus
from support.waiting import DEADLINE_S

from rcopterx.bus.clock import Clock
from rcopterx.bus.heartbeat import Heartbeat, LoopPhase
from rcopterx.bus.messages import TransmitterStatus
from rcopterx.bus.session import BusAddress, BusUnreachableError
from rcopterx.bus.wakeup import Wakeup
from rcopterx.transmitter_gateway import process
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest, State
from rcopterx.transmitter_gateway.radios import Radios

CAUGHT = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)
PRIORITY = 37
LONGEST_S = 20.0
"""Of virtual time, for a whole test."""

Condition = Callable[[], object]


@dataclass(frozen=True)
class VirtualClock(Clock):
    """The time of a bench, as the clock of a fleet."""

    time: Callable[[], float] = float

    @property
    def now(self) -> Callable[[], float]:
        return self.time


class OwnTurns:
    """The turns of a process in lockstep, counted; each ends at once."""

    count = 0

    def before_wait(self) -> None: ...

    def wake(self) -> None: ...

    def wait(self, timeout_s: float, descriptors: Collection[int] = ()) -> set[int]:
        self.count += 1
        return set(select.select(descriptors, [], [], timeout_s)[0])


class Program(Laboratory):
    """Runs a gateway process; after a turn the script goes on if the condition that it yielded last holds."""

    def begin(self) -> None:
        bus = replace(self.settings.bus, clock=VirtualClock(time=self.bus.clock))
        self.settings = replace(self.settings, realtime_priority=PRIORITY, bus=bus)
        self.page = bytearray(32)
        self.router_is_there = threading.Event()
        self.router_is_there.set()
        self.problem: Exception | None = None
        self.of_session: OwnTurns | None = None
        self.priorities: list[int] = []
        self.is_over = False
        self.joined_before_radios = False
        self._condition: Condition = bool

    def wakeup_for(self, clock: Clock) -> "Program":
        assert clock is self.settings.bus.clock
        return self

    def radios_for(self, *arguments: object) -> Radios:
        self.radios_of_gateway = Radios(*arguments)  # type: ignore[arg-type]  # as the process passes them
        self.note_writes()
        return self.radios_of_gateway

    def join(self, address: BusAddress, waiter: Wakeup) -> OwnBus:
        assert address is self.settings.bus
        assert waiter is self
        self.scheduled = self.of_session
        assert self.router_is_there.wait(DEADLINE_S)
        if self.problem is not None:
            raise self.problem
        self.joined_before_radios = not hasattr(self, "radios_of_gateway")
        return self.bus

    def request_realtime(self, priority: int) -> bool:
        self.priorities.append(priority)
        return True

    @property
    def phase(self) -> LoopPhase:
        """What the supervisor sees."""
        return LoopPhase(memoryview(self.page).cast("Q")[1])

    def run_script(self, script: Iterator[Condition]) -> None:
        self._script = script
        self._condition = next(script)
        process.run_gateway(self.settings)

    def wait(self, timeout_s: float, descriptors: Collection[int] = (), rest_s: float = 0.0) -> set[int]:
        assert self.bus.now_s < LONGEST_S, "the gateway does not end"
        ready = super().wait(timeout_s, descriptors, rest_s)
        try:
            if self._condition():
                self._condition = next(self._script, bool)
        except BaseException:
            self.router_is_there.set()
            raise
        return ready

    def close(self) -> None:
        self.is_over = True

    def after(self, seconds: float) -> Condition:
        end_s = self.bus.now_s + seconds
        return lambda: self.bus.now_s >= end_s

    def joined(self) -> bool:
        return bool(self.bus.inboxes)

    def request(self, action: Action) -> None:
        for name in NAMES:
            answer = self.transmitter(name).request(ActionRequest(action, by="operator"), self.bus.now_s)
            assert answer.accepted, answer

    def flight(self) -> Iterator[Condition]:
        yield self.joined
        self.bid()
        yield self.after(0.6)
        self.request(Action.ARM)
        self.thrust = 0.55
        yield self.after(0.4)
        assert self.states() == {State.ARMED}
        assert self.phase is LoopPhase.FLYING


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Program]:
    program = Program(tmp_path)
    for name, value in {
        "Wakeup": program.wakeup_for,
        "Radios": program.radios_for,
        "Session": program.join,
        "own_heartbeat": lambda: Heartbeat(program.page),
        "request_realtime": program.request_realtime,
        "prepare_loop": lambda: None,
    }.items():
        monkeypatch.setattr(process, name, value)
    handlers = {number: signal.getsignal(number) for number in CAUGHT}
    with Path("/dev/null").open() as nothing:
        monkeypatch.setattr("sys.stdin", nothing)
        yield program
    for number, handler in handlers.items():
        signal.signal(number, handler)
    super(Program, program).close()


def ports_are_closed(program: Program) -> bool:
    return not any(program.transmitter(name).port.is_open for name in NAMES)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_flight_ends_with_a_landing_when_the_process_shall_end(program: Program, number: int) -> None:
    def script() -> Iterator[Condition]:
        yield from program.flight()
        program.sinks = True
        signal.raise_signal(number)
        yield lambda: State.CUT in program.states()
        assert program.phase is LoopPhase.FLYING or program.states() == {State.CUT}

    program.run_script(script())
    assert program.states() == {State.CUT}
    assert {program.transmitter(name).arbiter.reason for name in NAMES} == {"landed: shutting down"}
    assert all(program.throttle_us[name][-25:] == [1100] * 25 for name in NAMES)
    assert ports_are_closed(program)
    assert program.phase is LoopPhase.ENDING
    assert (program.is_over, program.bus.is_closed) == (True, True)
    assert not program.joined_before_radios
    assert program.priorities == [PRIORITY]
    statuses = [message for _, message in program.bus.published if isinstance(message, TransmitterStatus)]
    assert all(status.realtime for status in statuses)


def test_in_lockstep_the_process_joins_the_bus_before_its_radios_open_and_waits_in_turns(
    program: Program,
) -> None:
    def script() -> Iterator[Condition]:
        yield from program.flight()
        program.sinks = True
        signal.raise_signal(signal.SIGTERM)

    bus = program.settings.bus
    program.settings = replace(program.settings, bus=replace(bus, clock=replace(bus.clock, lockstep=True)))
    turns = OwnTurns()
    program.of_session = turns
    program.run_script(script())
    assert program.states() == {State.CUT}
    assert program.joined_before_radios
    assert turns.count > 20


def test_a_signal_kills_once_and_the_process_goes_on(program: Program) -> None:
    def script() -> Iterator[Condition]:
        yield from program.flight()
        signal.raise_signal(signal.SIGUSR1)
        yield program.after(0.03)
        assert program.states() == {State.KILLED}
        assert program.transmitter("h1").arbiter.reason.endswith("by SIGUSR1")
        program.thrust = 0.0
        yield program.after(0.1)
        program.request(Action.RESET)
        yield program.after(0.5)
        assert program.states() == {State.DISARMED}
        signal.raise_signal(signal.SIGTERM)

    program.run_script(script())
    assert program.states() == {State.DISARMED}


def test_a_signal_kills_while_the_process_lands_its_vehicles(program: Program) -> None:
    def script() -> Iterator[Condition]:
        yield from program.flight()
        signal.raise_signal(signal.SIGTERM)
        yield program.after(0.5)
        assert program.states() == {State.LAND}
        signal.raise_signal(signal.SIGUSR1)

    program.run_script(script())
    assert program.states() == {State.KILLED}


def test_radios_are_served_and_can_be_killed_while_the_router_is_missing(program: Program) -> None:
    def script() -> Iterator[Condition]:
        yield program.after(1.0)
        assert min(len(writes) for writes in program.writes.values()) > 30
        assert program.phase is LoopPhase.WORKING
        signal.raise_signal(signal.SIGUSR1)
        yield program.after(0.03)
        assert program.states() == {State.KILLED}
        assert program.transmitter("h1").arbiter.reason.endswith("by SIGUSR1")
        assert not program.joined()
        program.router_is_there.set()
        yield program.joined
        signal.raise_signal(signal.SIGTERM)

    program.router_is_there.clear()
    program.run_script(script())
    assert program.bus.is_closed


def test_without_a_router_the_process_ends_and_closes_its_ports(program: Program) -> None:
    def script() -> Iterator[Condition]:
        yield program.after(1.0)
        assert not ports_are_closed(program)
        program.router_is_there.set()
        yield bool

    program.problem = BusUnreachableError("no router")
    program.router_is_there.clear()
    with pytest.raises(BusUnreachableError):
        program.run_script(script())
    assert ports_are_closed(program)


def test_an_error_before_the_router_answers_ends_the_process_on_throttle_low_frames(
    program: Program, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: dict[str, int] = {}

    def fails() -> None:
        raise RuntimeError("broken")

    def script() -> Iterator[Condition]:
        yield program.after(1.0)
        written.update({name: len(writes) for name, writes in program.writes.items()})
        monkeypatch.setattr(program.radios_of_gateway, "serve", fails)
        yield bool

    program.router_is_there.clear()
    with pytest.raises(RuntimeError, match="broken"):
        program.run_script(script())
    assert not program.router_is_there.is_set()
    program.router_is_there.set()
    assert all(len(program.writes[name]) >= written[name] + 25 for name in NAMES)
    assert {program.transmitter(name).finished for name in NAMES} == {True}
    assert ports_are_closed(program)


@pytest.mark.parametrize("killed", [False, True])
def test_an_error_lands_all_vehicles_before_it_ends_the_process(
    program: Program, monkeypatch: pytest.MonkeyPatch, killed: bool
) -> None:
    def fails() -> None:
        raise RuntimeError("broken")

    def script() -> Iterator[Condition]:
        yield from program.flight()
        program.sinks = not killed
        monkeypatch.setattr(program.bus, "pending", fails)
        yield program.after(0.5)
        assert program.states() == {State.LAND}
        assert program.phase is LoopPhase.FLYING
        if killed:
            signal.raise_signal(signal.SIGUSR1)

    with pytest.raises(RuntimeError, match="broken"):
        program.run_script(script())
    assert program.states() == {State.KILLED if killed else State.CUT}
    assert ports_are_closed(program)
    assert program.phase is LoopPhase.ENDING
