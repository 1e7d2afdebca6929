"""Promises of linked routers: a link that carries one direction only is opened again and carries both."""

import select
import socket
import threading
import uuid
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
import zenoh
from support.bus import FLEET, free_port, patient_links
from support.waiting import DEADLINE_S, PatientClock, wait_for

from rcopterx.bus import channels
from rcopterx.bus.endpoints import router_config
from rcopterx.bus.link_sockets import close_link
from rcopterx.bus.links import LinkService, open_links
from rcopterx.bus.session import BusAddress, Session

# A watch takes a stall for its own sleep and judges nothing; a few readings are less than that.
READING_S = 0.02


class Line:
    """A TCP line between two ends that can stop to carry one direction, without being closed."""

    def __init__(self, port: int, target: int) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self._target = target
        self._carried: list[tuple[socket.socket, socket.socket, threading.Event]] = []
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._accept)
        self._thread.start()

    def silence_answers(self) -> int:
        """From now on nothing comes back through the connections there are; returns how many."""
        for _, _, silent in self._carried:
            silent.set()
        return len(self._carried)

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self._listener.close()

    def _accept(self) -> None:
        threads = []
        while not self._ended.is_set():
            if select.select([self._listener], [], [], 0.05)[0]:
                near = self._listener.accept()[0]
                far = socket.create_connection(("127.0.0.1", self._target))
                silent = threading.Event()
                self._carried.append((near, far, silent))
                threads.append(threading.Thread(target=self._carry, args=(near, far, silent)))
                threads[-1].start()
        for thread in threads:
            thread.join()

    def _carry(self, near: socket.socket, far: socket.socket, silent: threading.Event) -> None:
        with near, far:
            while not self._ended.is_set():
                for ready in select.select([near, far], [], [], 0.05)[0]:
                    try:
                        data = ready.recv(65536)
                        if not data:
                            return
                        if ready is near or not silent.is_set():
                            (far if ready is near else near).sendall(data)
                    except OSError:
                        return


class Linked:
    """Routers of hosts `a` and `b` in this process; `b` dials `a` through a line."""

    def __init__(self, stack: ExitStack) -> None:
        namespace = f"t{uuid.uuid4().hex[:8]}"
        port, line_port, other_port = free_port(), free_port(), free_port()
        self.line = Line(line_port, port)
        stack.callback(self.line.close)
        self.routers = {
            "a": zenoh.open(router_config([f"tcp/127.0.0.1:{port}"], [], namespace)),
            "b": zenoh.open(
                router_config([f"tcp/127.0.0.1:{other_port}"], [f"tcp/127.0.0.1:{line_port}"], namespace)
            ),
        }
        for router in self.routers.values():
            stack.callback(router.close)
        for host, other in ("ab", "ba"):
            clock = PatientClock(READING_S)
            stack.callback(LinkService(self.routers[host], FLEET, host, [other], clock).close)
        addresses = (("a", port), ("b", other_port))
        self.sessions = {
            host: stack.enter_context(
                Session(BusAddress((f"tcp/127.0.0.1:{own}",), FLEET, namespace), timeout_s=DEADLINE_S)
            )
            for host, own in addresses
        }
        self._status = {
            host: self.sessions[other].subscribe(channels.ROUTER_STATUS, host) for host, other in ("ab", "ba")
        }

    def state(self, host: str, other: str) -> tuple[bool, int]:
        """State of the link as the other host receives it: linked, and the number of redials."""
        received = self._status[host].latest()
        if received is None:
            return False, 0
        state = received.message.links[other]
        return state.linked, state.redials

    def wait_watched(self, host: str) -> None:
        """Wait until the watch of a host has looked at all links that are open now."""
        # The one that looks while this is called may have begun before.
        for _ in range(2):
            before = self._status[host].latest()
            wait_for(lambda before=before: self._status[host].latest() is not before, "no status of links")


@pytest.fixture
def linked() -> Iterator[Linked]:
    # It is for the watch to find out which links carry nothing.
    with patient_links(), ExitStack() as stack:
        yield Linked(stack)


def test_a_link_that_carries_one_direction_only_is_opened_again(linked: Linked) -> None:
    wait_for(lambda: linked.state("a", "b")[0] and linked.state("b", "a")[0], "the routers are not linked")
    assert linked.line.silence_answers() > 0
    # Each status crosses the link, so both directions carry again.
    wait_for(lambda: linked.state("a", "b")[1] + linked.state("b", "a")[1] > 0, "the link was not closed")
    wait_for(lambda: linked.state("a", "b")[0] and linked.state("b", "a")[0], "the link was not opened again")


def test_clients_of_a_router_are_no_links_to_other_routers(linked: Linked) -> None:
    wait_for(lambda: len(open_links(linked.routers["a"])) == 1, "the routers are not linked")
    assert {link.router for link in open_links(linked.routers["a"])} == {str(linked.routers["b"].zid())}


def test_the_link_is_opened_again_when_it_ends(linked: Linked) -> None:
    router = linked.routers["a"]
    wait_for(lambda: len(open_links(router)) == 1, "the routers are not linked")
    linked.wait_watched("a")
    before = open_links(router)
    assert close_link(next(iter(before)))
    wait_for(
        lambda: len(open_links(router)) == 1 and not open_links(router) & before,
        "it was not opened again",
    )
    wait_for(lambda: linked.state("a", "b")[0] and linked.state("b", "a")[0], "the link does not carry")
