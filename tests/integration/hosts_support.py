"""A fleet over network namespaces as hosts, started as by a user, and the commands its gateway applied."""

import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from itertools import groupby, pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pytest
from integration_support import Flying, fleet_text
from support.namespaces import NetworkNamespaces, network_or_skip

from rcopterx.bus import channels
from rcopterx.bus.codec import decode
from rcopterx.bus.messages import Applied
from rcopterx.bus.session import RawMessage, Session
from rcopterx.bus.subscription import Received
from rcopterx.deploy.certificates.fleet_certificates import make_certificates
from rcopterx.fleet.reading import load_fleet
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.daemons import Daemons
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx_studies.faults.flight_promises import NEEDED

ROUTER_PORT = 7447
TRACKER_PORT = 8010
FIRST_ROUTER_S = 180.0
"""Limit that includes compiling the kernels."""
START_S = 120.0
RECEIVING_PRIORITY = 1
STEADY_S = 3.0
LONGEST_POSE_GAP_S = 0.1
NEAR_S = 0.1
"""Before and after a change of the agent."""


@contextmanager
def fleet_on_hosts(
    directory: Path,
    names: Sequence[str],
    *,
    spares: tuple[str, ...] = (),
    certificates: bool = False,
    simulator: str = "",
) -> Iterator[tuple[NetworkNamespaces, Flying]]:
    """Start a trio over hosts, the first one with its gateways, the second one with its agents.

    Each host runs its daemon, and the fleet is started through them, as in a laboratory. `RCOPTERX_RUN` is
    that of the first host; the others have theirs beside it. The test itself uses the Unix socket of the
    router of the first host. The processes of all hosts share a few cores, so the fleet needs time to settle.
    """
    with ExitStack() as stack:
        net = stack.enter_context(network_or_skip(names))
        path = directory / "lab.toml"
        hosts = {host: (net.addresses[host], ROUTER_PORT) for host in names}
        security = f'certificates = "{directory / "certificates"}"' if certificates else "insecure = true"
        text = fleet_text(
            TRACKER_PORT, hosts, agent_host=names[1], spares=spares, security=security, simulator=simulator
        )
        path.write_text(text)
        if certificates:
            make_certificates(load_fleet(path), datetime.now(UTC), days=100)
        for host in names:
            stack.enter_context(daemon(net, path, host))
        fleet = Fleet(load_fleet(path), host=names[0], timeout_s=FIRST_ROUTER_S)
        stack.callback(fleet.close)
        stack.callback(restore_thread_priority)
        raise_thread_priority()
        fleet.wait_until(lambda: fleet.launchers().keys() == set(names), FIRST_ROUTER_S, "no daemons")
        daemons = Daemons(fleet)
        fleet.wait_until(lambda: not daemons.find(), START_S, "the hosts are not linked")
        assert len(daemons.start()) == len(names)
        fleet.wait_ready(timeout_s=START_S)
        fleet.wait_until(
            lambda: all(status.spare_ready for status in fleet.launchers().values()),
            START_S,
            "no spare processes",
        )
        fleet.wait_until(Steady(fleet), START_S, "poses do not come regularly")
        fleet.wait_ready(timeout_s=START_S)
        flying = Flying(path, fleet, {}, FlightSampler(fleet.session, only=NEEDED))
        flying.recorder.start()
        yield net, flying
        flying.check_promises()


@contextmanager
def daemon(net: NetworkNamespaces, path: Path, host: str) -> Iterator[None]:
    """The daemon of a host of a fleet file, which writes its log beside that file."""
    words = ("-m", "rcopterx", "host", str(path), "--host", host)
    run_directory_of(host).mkdir(mode=0o700)
    with (
        path.with_name(f"host-{host}.log").open("wb") as output,
        net.running(host, words, environment_of(host), output),
    ):
        yield


@contextmanager
def trio_in_flight(
    directory: Path,
    names: Sequence[str],
    monkeypatch: pytest.MonkeyPatch,
    *,
    spares: tuple[str, ...] = (),
    certificates: bool = False,
    simulator: str = "",
) -> Iterator[tuple[NetworkNamespaces, Flying]]:
    """`fleet_on_hosts` in formation; the test is skipped where there are no network namespaces."""
    with ExitStack() as stack:
        # A short path, because the routers' sockets live in it.
        run = stack.enter_context(TemporaryDirectory(prefix="rcopterx-"))
        monkeypatch.setenv("RCOPTERX_RUN", str(Path(run) / names[0]))
        hosts = fleet_on_hosts(
            directory, names, spares=spares, certificates=certificates, simulator=simulator
        )
        net, flying = stack.enter_context(hosts)
        flying.fleet.take_off()
        flying.fleet.wait_for_formation()
        yield net, flying


def raise_thread_priority() -> None:
    """Schedule the present threads of this process before other programs, but after those of fleets.

    A router drops messages of a slow client. On a busy computer a test would miss up to seconds without this,
    and mistake it for silence of the fleet.
    """
    _schedule_threads(os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, RECEIVING_PRIORITY)


def restore_thread_priority() -> None:
    """Undo `raise_thread_priority`."""
    _schedule_threads(os.SCHED_OTHER, 0)


def _schedule_threads(policy: int, priority: int) -> None:
    for thread in os.listdir("/proc/self/task"):
        with suppress(ProcessLookupError):
            os.sched_setscheduler(int(thread), policy, os.sched_param(priority))


def run_directory_of(host: str) -> Path:
    """Where the run directories of a host are, while `RCOPTERX_RUN` is that of another one."""
    return Path(os.environ["RCOPTERX_RUN"]).with_name(host)


def environment_of(host: str) -> dict[str, str]:
    """Environment of programs on a host."""
    return os.environ | {"RCOPTERX_RUN": str(run_directory_of(host))}


def kill_host(net: NetworkNamespaces, host: str) -> None:
    """Cut the link of a host and kill its processes."""
    net.cut(host)
    listed = subprocess.run(
        ["ip", "netns", "pids", net.namespace(host)], capture_output=True, text=True, check=True
    )
    for process in map(int, listed.stdout.split()):
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


class Steady:
    """Whether poses have come without a gap for a while."""

    def __init__(self, fleet: Fleet) -> None:
        self._inbox = fleet.session.subscribe(channels.POSE, "h1", depth=256)
        self._last_s = self._since_s = time.monotonic()

    def __call__(self) -> bool:
        for received in self._inbox.drain():
            if received.arrived_s - self._last_s > LONGEST_POSE_GAP_S:
                self._since_s = received.arrived_s
            self._last_s = received.arrived_s
        return self._last_s - self._since_s > STEADY_S


class Change(NamedTuple):
    """From the last applied command of one agent to the first one of its successor.

    Attributes
    ----------
    gap_s
        Between the serial frames of the two.
    missed
        Frames of the motion capture, from a while before to a while after, that no command belongs to.
    """

    gap_s: float
    missed: int


class Obeyed:
    """Commands that the transmitter gateway applied, by vehicle.

    Its own session keeps other subscriptions from making it lose messages; it counts lost ones.
    """

    def __init__(self, flying: Flying, names: tuple[str, ...]) -> None:
        self._waiting: dict[str, deque[RawMessage]] = {name: deque() for name in names}
        self._frames: dict[str, list[Received[Applied]]] = {name: [] for name in names}
        self._numbers: dict[str, int] = {}
        self._lost = 0
        self._session = Session(flying.fleet.session.address)
        raise_thread_priority()
        self._session.tap(lambda raw: self._waiting[raw.unit].append(raw), channels.APPLIED.topic)

    def frames(self, name: str) -> list[Received[Applied]]:
        """Everything that was written to the radio so far."""
        waiting = self._waiting[name]
        while waiting:
            raw = waiting.popleft()
            last = self._numbers.get(name, raw.number - 1)
            # A gateway that took over counts from one again.
            self._lost += max(0, raw.number - last - 1)
            self._numbers[name] = raw.number
            message = decode(raw.payload, Applied)
            self._frames[name].append(Received(message, raw.arrived_s))
        return self._frames[name]

    def lost(self) -> int:
        """Number of lost frames of all vehicles; figures are exact if it is zero."""
        for name in self._waiting:
            self.frames(name)
        return self._lost

    def since(self, name: str, from_s: float) -> float | None:
        """When a fresh command was obeyed for the first time after a moment [monotonic s]."""
        return next(
            (
                frame.arrived_s
                for frame in self.frames(name)
                if frame.arrived_s > from_s and frame.message.fresh and frame.message.state == "armed"
            ),
            None,
        )

    def changes(self, name: str, from_s: float) -> list[Change]:
        """Every time that another agent took over since a moment [monotonic s]."""
        flown = self._flown(name, from_s)
        found = []
        for before, after in pairwise(flown):
            if before.lease != after.lease:
                near = [m for m in flown if abs(m.written_s - after.written_s) < NEAR_S]
                found.append(Change(after.written_s - before.written_s, _missed(near)))
        return found

    def longest_silence_s(self, name: str, from_s: float) -> float:
        """Longest time between two commands that flew a vehicle, the second after a moment [monotonic s]."""
        times = [command.written_s for command in self._flown(name, from_s - NEAR_S)]
        return max(after - before for before, after in pairwise(times))

    def missed(self, name: str, from_s: float) -> int:
        """Frames of the motion capture since a moment [monotonic s] that no obeyed command belongs to."""
        return _missed(self._flown(name, from_s - NEAR_S))

    def _flown(self, name: str, from_s: float) -> list[Applied]:
        return [
            frame.message
            for frame in self.frames(name)
            if frame.arrived_s > from_s and frame.message.fresh and frame.message.state == "armed"
        ]

    def leases(self, name: str) -> list[int]:
        """Leases that flew a vehicle, in order."""
        fresh = (frame.message.lease for frame in self.frames(name) if frame.message.fresh)
        return [lease for lease, _ in groupby(fresh)]

    def states(self, name: str, from_s: float) -> list[str]:
        """States of the arbiter after a moment, without repetitions."""
        states = (frame.message.state for frame in self.frames(name) if frame.arrived_s > from_s)
        return [state for state, _ in groupby(states)]


def _missed(commands: Sequence[Applied]) -> int:
    frames = {command.frame for command in commands}
    return max(frames) - min(frames) + 1 - len(frames)
