"""What routers carry: the messages of many vehicles on several hosts, through real routers.

    python -m rcopterx.benchmarks.message_load --hosts 2 --vehicles 10

Nothing flies: programs publish what agents and gateways would, as often, as long and to the same listeners,
by the table of channels. Every host has a router of its own, linked to all others. Hosts are processes of
this computer, so that only a few of them show what a router needs; what it needs for a message goes for more.
"""

import argparse
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

from rcopterx.benchmarks.programs import router_words, running
from rcopterx.benchmarks.scale import cpu_s
from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.session import BusAddress, Session
from rcopterx.deploy.processes.forking import child_environment

FLEET: Final = "load"
NEAR: Final = 3
"""Vehicles beside its leader whose plans an agent hears."""
START_S: Final = 30.0
SETTLE_S: Final = 2.0
"""Subscriptions reach all routers meanwhile; what it costs to tell them is not measured."""
LOOK_S: Final = 0.1
BYTES: Final[dict[Channel[Any], int]] = {
    channels.POSE: 225, channels.PLAN: 400, channels.COMMAND: 320, channels.APPLIED: 300,
    channels.AGENT_STATUS: 900, channels.INTENT: 500, channels.TRANSMITTER_STATUS: 600,
}  # fmt: skip
"""Length of a message in a recorded flight, about."""
OF_TRACKER: Final = (channels.POSE,)
OF_AGENT: Final = (channels.PLAN, channels.COMMAND, channels.AGENT_STATUS, channels.INTENT)
OF_GATEWAY: Final = (channels.APPLIED, channels.TRANSMITTER_STATUS)


class Stream(NamedTuple):
    """Messages that a program of a host publishes."""

    host: int
    program: str
    channel: Channel[Any]
    vehicle: str


class Listening(NamedTuple):
    """What a program of a host subscribes to; `vehicle` is `*` for all."""

    host: int
    program: str
    channel: Channel[Any]
    vehicle: str

    def hears(self, stream: Stream) -> bool:
        """Whether a message of the stream is for it."""
        return self.channel is stream.channel and self.vehicle in ("*", stream.vehicle)


def name_of(host: int, number: int) -> str:
    """Name of a vehicle."""
    return f"v{host}-{number}"


def streams(hosts: int, vehicles: int) -> list[Stream]:
    """Everything that is published.

    Parameters
    ----------
    hosts
        How many; the first one has the Tracker.
    vehicles
        On each of them.
    """
    found = []
    for host in range(hosts):
        for vehicle in (name_of(host, number) for number in range(vehicles)):
            found += [Stream(0, "tracker", channel, vehicle) for channel in OF_TRACKER]
            found += [Stream(host, vehicle, channel, vehicle) for channel in OF_AGENT]
            found += [Stream(host, "gateway", channel, vehicle) for channel in OF_GATEWAY]
    return found


def listenings(hosts: int, vehicles: int) -> list[Listening]:
    """Everything that is subscribed to; the first vehicle of each host leads the others of it."""
    found = [Listening(0, "tracker", channel, "*") for channel in (channels.APPLIED, channels.INTENT)]
    for host in range(hosts):
        own = [name_of(host, number) for number in range(vehicles)]
        found.append(Listening(host, "gateway", channels.POSE, "*"))
        for number, vehicle in enumerate(own):
            near = [own[(number + step) % vehicles] for step in range(1, min(NEAR + 1, vehicles))]
            heard = dict.fromkeys([*own[: min(number, 1)], *near])
            found += [Listening(host, vehicle, channels.PLAN, other) for other in heard]
            found += [
                Listening(host, vehicle, channel, vehicle) for channel in (channels.POSE, channels.APPLIED)
            ]
            found.append(Listening(host, vehicle, channels.AGENT_STATUS, "*"))
            found.append(Listening(host, "gateway", channels.COMMAND, vehicle))
            found += [
                Listening(host, "launcher", channel, vehicle)
                for channel in (channels.APPLIED, channels.INTENT, channels.TRANSMITTER_STATUS)
            ]
        found.append(Listening(host, "launcher", channels.AGENT_STATUS, "*"))
    return found


def copies_hz(host: int, said: Sequence[Stream], heard: Sequence[Listening]) -> tuple[float, float]:
    """Messages a second that a router hands to programs of its host, and that it sends to other hosts."""
    local = remote = 0.0
    for stream in said:
        at = [listening.host for listening in heard if listening.hears(stream)]
        local += stream.channel.rate_hz * at.count(host)
        if stream.host == host:
            remote += stream.channel.rate_hz * len({other for other in at if other != host})
    return local, remote


def run(hosts: int, vehicles: int, seconds: float) -> list[dict[str, Any]]:
    """Let messages pass and measure.

    Parameters
    ----------
    hosts
        How many routers.
    vehicles
        On each host.
    seconds
        For how long.

    Returns
    -------
    list[dict]
        For each host: messages a second to its programs (`local_hz`) and to other hosts (`remote_hz`),
        what its `router` takes of a processor, and for one `command` and one `pose` the `arrived` share,
        `p50_ms` and `p99_ms`.
    """
    said, heard = streams(hosts, vehicles), listenings(hosts, vehicles)
    with _routers(hosts) as (pids, sockets), ExitStack() as stack:
        module = ("-m", "rcopterx.benchmarks.message_programs")
        programs = [
            stack.enter_context(_python((*module, router, str(host), str(hosts), str(vehicles))))
            for host, router in enumerate(sockets)
        ]
        for program in programs:
            _answer_of(program)
        time.sleep(SETTLE_S)
        for program in programs:
            _ask(program, "measure")
        before_s = [cpu_s(pid) for pid in pids]
        began_s = time.monotonic()
        time.sleep(seconds)
        lasted_s = time.monotonic() - began_s
        shares = [(cpu_s(pid) - before) / lasted_s for pid, before in zip(pids, before_s, strict=True)]
        told = []
        for program in programs:
            _ask(program, "tell")
            told.append(json.loads(_answer_of(program)))
    rows = []
    for host in range(hosts):
        local_hz, remote_hz = copies_hz(host, said, heard)
        rows.append({"local_hz": local_hz, "remote_hz": remote_hz, "router": shares[host], **told[host]})
    return rows


@contextmanager
def _routers(hosts: int) -> Iterator[tuple[list[int], list[str]]]:
    """Process and Unix socket of a router for each host; each is linked to all others."""
    names = [f"host{host}" for host in range(hosts)]
    with TemporaryDirectory(prefix="rcopterx-") as directory, ExitStack() as stack:
        sockets = [f"unixsock-stream/{Path(directory) / name}.sock" for name in names]
        ports = [f"tcp/127.0.0.1:{port}" for port in _free_ports(hosts)]
        pids = []
        for host, name in enumerate(names):
            others = [other for other in names if other != name]
            words = router_words([sockets[host], ports[host]], ports[:host], FLEET, name, others)
            pids.append(stack.enter_context(_python(words)).pid)
        for host in range(hosts):
            with Session(BusAddress((sockets[host],), FLEET), timeout_s=START_S) as session:
                until_s = time.monotonic() + START_S
                while len(session.identify()) < hosts:
                    if time.monotonic() > until_s:
                        raise RuntimeError(f"router of {names[host]}: not linked to all others")
                    time.sleep(LOOK_S)
        yield pids, sockets


def _free_ports(number: int) -> list[int]:
    with ExitStack() as stack:
        opened = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(number)]
        return [one.getsockname()[1] for one in opened]


def _python(words: Sequence[str]) -> "AbstractContextManager[subprocess.Popen[str]]":
    """Python with these arguments, whose standard streams are pipes."""
    return running(
        [sys.executable, *words],
        signal.SIGTERM,
        env=child_environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _ask(process: "subprocess.Popen[str]", what: str) -> None:
    assert process.stdin is not None
    process.stdin.write(f"{what}\n")
    process.stdin.flush()


def _answer_of(process: "subprocess.Popen[str]") -> str:
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise RuntimeError("the programs of a host have ended")
    return line


def main() -> None:
    """Print a line for each host."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hosts", type=int, default=2, metavar="N")
    parser.add_argument("--vehicles", type=int, default=10, metavar="N", help="On each host.")
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S")
    options = parser.parse_args()
    print(f"{'host':>4}{'copies/s':>10}{'to hosts/s':>12}{'router':>9}{'us each':>9}", end="")
    print(f"{'command arrived, p50, p99 [ms]':>34}{'pose arrived, p50, p99 [ms]':>32}")
    for host, row in enumerate(run(options.hosts, options.vehicles, options.seconds)):
        each_us = 1e6 * row["router"] / (row["local_hz"] + row["remote_hz"])
        print(
            f"{host:>4}{row['local_hz']:>10.0f}{row['remote_hz']:>12.0f}{row['router']:>9.1%}{each_us:>9.1f}",
            end="",
        )
        for probe in (row["command"], row["pose"]):
            print(f"{probe['arrived']:>18.1%}{probe['p50_ms']:>7.2f}{probe['p99_ms']:>7.2f}", end="")
        print()


if __name__ == "__main__":
    main()
