"""A bus of their own for tests: a router on a free port, a namespace of its own."""

import json
import secrets
import signal
import socket
import subprocess
import sys
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import pytest
import zenoh

from rcopterx.bus import channels
from rcopterx.bus.endpoints import client_config, open_session, router_config
from rcopterx.bus.messages import Pose
from rcopterx.bus.requests import Reply, Request
from rcopterx.bus.session import BusAddress, RequestFailedError, Session
from rcopterx.bus.subscription import Inbox
from rcopterx.bus.wakeup import Waiter
from support.waiting import DEADLINE_S, wait_for

FLEET = "lab"
LOWEST_PORT, PORTS = 20_000, 12_000


class Calls(Waiter):
    """Calls a function with every notification."""

    def __init__(self, call: Callable[[], object]) -> None:
        self._call = call

    def notify(self) -> None:
        self._call()

    def _wait(self, *_: object) -> set[int]:
        raise NotImplementedError


def free_port(address: str = "127.0.0.1", kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """A port that is free at this moment, below the ephemeral ports of Linux."""
    while True:
        port = LOWEST_PORT + secrets.randbelow(PORTS)
        with socket.socket(type=kind) as probe, suppress(OSError):
            probe.bind((address, port))
            return port


def own_address() -> BusAddress:
    """Address of a bus that no other test uses."""
    return BusAddress((f"tcp/127.0.0.1:{free_port()}",), FLEET, f"t{uuid.uuid4().hex[:8]}")


@contextmanager
def patient_links() -> Iterator[None]:
    """Zenoh takes no connection that this process opens for dead, for as long as the block lasts.

    Both ends and the router are in one process, which a busy machine may stall for longer than a lease.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rcopterx.bus.endpoints.LEASE_MS", 60_000)
        yield


@contextmanager
def router() -> Iterator[BusAddress]:
    """A router in this process, for tests in which it stays up."""
    address = own_address()
    session = open_session(router_config(list(address.endpoints), [], address.namespace))
    try:
        yield address
    finally:
        session.close()


class Child:
    """A real process that runs a few lines of Python; ended by its pid."""

    def __init__(self, code: str, *arguments: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", code, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE
        )

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def wait_ready(self) -> None:
        """Wait until the child prints a line."""
        assert self._process.stdout is not None
        assert self._process.stdout.readline(), "the child ended before it was ready"

    def end(self, number: signal.Signals = signal.SIGKILL) -> int:
        """Send a signal and wait for the end; returns the exit code."""
        if self._process.poll() is None:
            self._process.send_signal(number)
        code = self._process.wait(DEADLINE_S)
        if self._process.stdout is not None:
            self._process.stdout.close()
        return code


ROUTER_CODE = """
import json, sys
from rcopterx.bus.router import run_router
run_router(*json.loads(sys.argv[1]))
"""


class RouterProcess(Child):
    """The router as the launcher runs it: in a process that can be killed."""

    def __init__(self, address: BusAddress) -> None:
        self._address = address
        super().__init__(ROUTER_CODE, json.dumps([list(address.endpoints), [], address.namespace, 0]))

    def wait_ready(self) -> None:
        """Wait until a client gets in."""
        Session(self._address, timeout_s=DEADLINE_S).close()


@contextmanager
def answering(server: Session, reply: Callable[[Request], Reply]) -> Iterator[None]:
    """A thread that answers what arrives at a session, as a process's loop does."""
    stop = threading.Event()

    def work() -> None:
        while not stop.wait(0.002):
            for incoming in server.pending():
                incoming.answer(reply(incoming.request))

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def asked(session: Session, unit: str, request: Request) -> Reply:
    """Reply of a process that serves the request, or is about to."""
    return session.request(unit, request, timeout_s=DEADLINE_S, patience_s=DEADLINE_S)


def raw_put(address: BusAddress, key: str, payload: bytes) -> None:
    """Put bytes on any key, as a faulty or foreign program would."""
    with raw_session(address) as session:
        session.put(key, payload)


@contextmanager
def raw_session(address: BusAddress) -> Iterator[zenoh.Session]:
    """A Zenoh client without any of our checks."""
    session = open_session(client_config(list(address.endpoints), address.namespace, DEADLINE_S))
    try:
        yield session
    finally:
        session.close()


def occluded_pose(frame: int) -> Pose:
    return Pose(epoch=1, frame=frame, period_s=0.02, latency_s=0.0, received_s=0.0, occluded=True)


def arrives(sender: Session, inbox: Inbox[Pose], frame: int) -> None:
    """Publish until a pose gets through: the first put after a declaration may be lost."""

    def through() -> bool:
        sender.publish(channels.POSE, "h1", occluded_pose(frame))
        received = inbox.latest()
        return received is not None and received.message.frame == frame

    wait_for(through, f"frame {frame} does not arrive")


def answer_of(asker: Session, unit: str, request: Request) -> Reply:
    """Send a request as soon as it is served."""
    replies: list[Reply] = []
    problems: list[str] = []

    def answered() -> bool:
        try:
            replies.append(asker.request(unit, request, timeout_s=DEADLINE_S))
        except RequestFailedError as error:
            problems.append(str(error))
            return False
        return True

    wait_for(answered, "no answer")
    assert all("no process serves" in problem for problem in problems)
    return replies[0]
