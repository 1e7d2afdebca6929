"""Time until two linked hosts exchange data again after their link was cut and restored."""

import json
import signal
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from rcopterx.bus.endpoints import client_config, open_session
from rcopterx.bus.session import BusAddress, Session
from rcopterx.deploy.processes.forking import child_environment
from support.namespaces import NetworkNamespaces, network

HOSTS: Final = ("a", "b")
FLEET: Final = "bench"
PORT: Final = 7447
PERIOD_S: Final = 0.01
PLANS: Final = 3
PLAN_BYTES: Final = 9700
FRESH_S: Final = 0.03  # largest age of a fresh sample on arrival
STALE_S: Final = 0.1
SETTLE_S: Final = 1.0
LIMIT_S: Final = 15.0  # a link that has not healed by then counts as dead
_STAMP = struct.Struct("<d")
_ROUTER: Final = """
import json, sys
from rcopterx.bus.requests import IdentifyReply
from rcopterx.bus.router import run_router
listen, connect, fleet, host, others = json.loads(sys.argv[1])
identity = IdentifyReply(accepted=True, fleet=fleet, host=host, digest="", vehicles=())
run_router(listen, connect, None, 26, identity, others)
"""


class CommandStream:
    """Samples like those of three vehicles between two hosts, processes of one computer and clock."""

    def __init__(self, sender: zenoh.Session, receiver: zenoh.Session, name: str) -> None:
        self.arrivals: list[tuple[float, float]] = []
        publisher = partial(sender.declare_publisher, congestion_control=zenoh.CongestionControl.DROP)
        self._commands = publisher(f"{name}/command", priority=zenoh.Priority.REAL_TIME)
        self._plans = [
            publisher(f"{name}/plan/{number}", priority=zenoh.Priority.INTERACTIVE_HIGH)
            for number in range(PLANS)
        ]
        self._subscribers = [
            receiver.declare_subscriber(f"{name}/command", Callback(self._on_sample, indirect=False)),
            receiver.declare_subscriber(f"{name}/plan/*", Callback(_ignore, indirect=False)),
        ]

    def _on_sample(self, sample: zenoh.Sample) -> None:
        (sent_s,) = _STAMP.unpack(sample.payload.to_bytes())
        self.arrivals.append((time.monotonic(), sent_s))

    def send(self, with_plans: bool) -> None:
        """Send a sample, and the plans that go with every second one."""
        self._commands.put(_STAMP.pack(time.monotonic()))
        if with_plans:
            for plan in self._plans:
                plan.put(bytes(PLAN_BYTES))

    def fresh_since(self, from_s: float) -> float | None:
        """Arrival of the first fresh sample after a moment."""
        return next((at for at, sent in self.arrivals if at > from_s and at - sent < FRESH_S), None)

    def figures(self, cut_s: float, restored_s: float) -> dict[str, Any]:
        """Figures of one cut: time until fresh samples arrive again, longest gap, number of late samples."""
        fresh_s = self.fresh_since(restored_s)
        around = [at for at, _ in self.arrivals if at > cut_s - 0.1]
        gaps = [later - earlier for earlier, later in pairwise(around)]
        return {
            "heal_ms": None if fresh_s is None else 1e3 * (fresh_s - restored_s),
            "gap_ms": 1e3 * max(gaps, default=0.0),
            "stale": sum(at - sent > STALE_S for at, sent in self.arrivals if at > cut_s),
        }


def measured_cut(net: NetworkNamespaces, streams: dict[str, CommandStream], cut_s: float) -> dict[str, Any]:
    """Cut for a time, restore, wait until both directions carry fresh samples."""
    time.sleep(SETTLE_S)
    for stream in streams.values():
        stream.arrivals.clear()
    time.sleep(0.1)
    began_s = time.monotonic()
    net.cut("b")
    time.sleep(cut_s)
    net.restore("b")
    restored_s = time.monotonic()
    while time.monotonic() < restored_s + LIMIT_S:
        if all(stream.fresh_since(restored_s) is not None for stream in streams.values()):
            break
        time.sleep(0.01)
    time.sleep(0.3)
    return {name: stream.figures(began_s, restored_s) for name, stream in streams.items()}


@contextmanager
def linked_hosts() -> Iterator[tuple[NetworkNamespaces, dict[str, CommandStream]]]:
    """Two hosts with a router each, and a stream in both directions."""
    with ExitStack() as stack:
        net = stack.enter_context(network(HOSTS))
        directory = Path(stack.enter_context(TemporaryDirectory(prefix="rcopterx-")))
        sockets = {host: f"unixsock-stream/{directory / host}.sock" for host in HOSTS}
        endpoints = {host: f"tcp/{net.addresses[host]}:{PORT}" for host in HOSTS}
        for host, other in (("a", "b"), ("b", "a")):
            dialled = [endpoints["a"]] if host == "b" else []
            settings = json.dumps([[sockets[host], endpoints[host]], dialled, FLEET, host, [other]])
            words, quiet = ("-c", _ROUTER, settings), subprocess.DEVNULL
            stack.enter_context(net.running(host, words, child_environment(), quiet, signal.SIGTERM))
        for host in HOSTS:
            Session(BusAddress((sockets[host],), FLEET), timeout_s=20.0).close()
        clients = {host: open_session(client_config([sockets[host]], None, 5.0)) for host in HOSTS}
        for client in clients.values():
            stack.callback(client.close)
        streams = {
            f"{host} to {other}": CommandStream(clients[host], clients[other], f"from-{host}")
            for host, other in ("ab", "ba")
        }
        stack.enter_context(_sending(list(streams.values())))
        started_s = time.monotonic()
        while not all(stream.arrivals for stream in streams.values()):
            if time.monotonic() > started_s + LIMIT_S:
                raise RuntimeError("the two routers are not linked")
            time.sleep(0.01)
        yield net, streams


def _ignore(_: zenoh.Sample) -> None:
    """Plans only load the link."""


@contextmanager
def _sending(streams: list[CommandStream]) -> Iterator[None]:
    ended = threading.Event()

    def work() -> None:
        number = 0
        while not ended.wait(PERIOD_S):
            number += 1
            for stream in streams:
                stream.send(with_plans=number % 2 == 0)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
