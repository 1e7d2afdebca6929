"""A fleet over network namespaces as hosts, started as a user starts it, and what its gateway did."""

import os
import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from integration_support import Flying, fleet_text

from rcopterx.benchmarks.namespaces import Network, NetworkUnavailableError, network
from rcopterx.bus import channels
from rcopterx.bus.messages import Applied
from rcopterx.bus.subscription import Received
from rcopterx.deploy.certificates.fleet_certificates import make_certificates
from rcopterx.deploy.fleet_file.reading import load_fleet
from rcopterx.ground_station.fleet import Fleet

HOSTS = ("main", "second")
"""The simulated laboratory and its gateways; the agents."""
ROUTER_PORT = 7447
TRACKER_PORT = 8010
STOP_S = 30.0


@contextmanager
def fleet_on_hosts(
    directory: Path, names: Sequence[str], *, spares: tuple[str, ...] = (), certificates: bool = False
) -> Iterator[tuple[Network, Flying]]:
    """Start a trio over hosts, the first one with its gateways, the second one with its agents.

    `RCOPTERX_RUN` has to be set. With certificates, they are made first, and everything between the hosts is
    encrypted. The test itself is on no host: it uses the Unix socket of the router of the first one.
    """
    with ExitStack() as stack:
        net = stack.enter_context(network(names))
        path = directory / "lab.toml"
        hosts = {host: (net.addresses[host], ROUTER_PORT) for host in names}
        security = f'certificates = "{directory / "certificates"}"' if certificates else "insecure = true"
        text = fleet_text(TRACKER_PORT, hosts, agent_host=names[1], spares=spares, security=security)
        path.write_text(text)
        if certificates:
            make_certificates(load_fleet(path), datetime.now(UTC), days=1)
        for host in names:
            command = net.python(host, "-m", "rcopterx", "up", str(path), "--host", host)
            stack.enter_context(_started(command, directory / f"up-{host}.log"))
        fleet = Fleet(load_fleet(path), host=names[0], timeout_s=30)
        stack.callback(fleet.close)
        fleet.wait_ready(timeout_s=40)
        yield net, Flying(path, fleet, {})


@contextmanager
def trio_in_flight(
    directory: Path,
    names: Sequence[str],
    monkeypatch: pytest.MonkeyPatch,
    *,
    spares: tuple[str, ...] = (),
    certificates: bool = False,
) -> Iterator[tuple[Network, Flying]]:
    """`fleet_on_hosts` in formation; the test is skipped where there are no network namespaces."""
    try:
        with network(["probe"]):
            pass
    except NetworkUnavailableError as error:
        pytest.skip(str(error))
    with ExitStack() as stack:
        # A short path, because the routers' sockets live in it.
        run = stack.enter_context(TemporaryDirectory(prefix="rcopterx-"))
        monkeypatch.setenv("RCOPTERX_RUN", run)
        hosts = fleet_on_hosts(directory, names, spares=spares, certificates=certificates)
        net, flying = stack.enter_context(hosts)
        flying.fleet.take_off()
        flying.fleet.wait_for_formation()
        yield net, flying


def kill_host(net: Network, host: str) -> None:
    """Let a host die: nothing of it is heard any more, and nothing of it runs."""
    net.cut(host)
    listed = subprocess.run(
        ["ip", "netns", "pids", net.namespace(host)], capture_output=True, text=True, check=True
    )
    for process in map(int, listed.stdout.split()):
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


@contextmanager
def _started(command: list[str], log: Path) -> Iterator[None]:
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, env=os.environ)
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class Obeyed:
    """Which commands the transmitter gateway obeyed, by vehicle."""

    def __init__(self, flying: Flying, names: tuple[str, ...]) -> None:
        self._inboxes = {
            name: flying.fleet.session.subscribe(channels.APPLIED, name, depth=8192) for name in names
        }
        self._frames: dict[str, list[Received[Applied]]] = {name: [] for name in names}

    def frames(self, name: str) -> list[Received[Applied]]:
        """Everything that was written to the radio so far."""
        self._frames[name] += self._inboxes[name].drain()
        return self._frames[name]

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

    def longest_gap_s(self, name: str, from_s: float) -> float:
        """Longest time between two commands that flew the vehicle, since a moment [monotonic s]."""
        flown = [
            frame.arrived_s
            for frame in self.frames(name)
            if frame.arrived_s > from_s and frame.message.fresh and frame.message.state == "armed"
        ]
        return max(after - before for before, after in pairwise(flown))

    def leases(self, name: str) -> list[int]:
        """Leases that flew a vehicle, in order."""
        told: list[int] = []
        for frame in self.frames(name):
            if frame.message.fresh and (not told or told[-1] != frame.message.lease):
                told.append(frame.message.lease)
        return told

    def states(self, name: str, from_s: float) -> list[str]:
        """States of the arbiter after a moment, without repetitions."""
        told: list[str] = []
        for frame in self.frames(name):
            if frame.arrived_s > from_s and (not told or told[-1] != frame.message.state):
                told.append(frame.message.state)
        return told
