"""Promises of what is done to sockets of links: exactly the one that is meant, and at once."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from rcopterx.bus.link_sockets import (
    DIAL_LIMIT_S,
    LONGEST_DIAL_S,
    Dials,
    close_link,
    congestion_control,
    hasten,
)
from rcopterx.bus.link_watch import RouterLink


class Connection:
    """Both ends of a TCP connection of this process."""

    def __init__(self, stack: ExitStack) -> None:
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        self.near = stack.enter_context(socket.create_connection(listener.getsockname()))
        self.far = stack.enter_context(listener.accept()[0])
        self.far.settimeout(60.0)
        self.link = RouterLink("b0", self.near.getsockname(), self.near.getpeername())


@pytest.fixture
def connections() -> Iterator[tuple[Connection, Connection]]:
    with ExitStack() as stack:
        yield Connection(stack), Connection(stack)


def test_only_the_socket_of_the_link_is_closed(connections: tuple[Connection, Connection]) -> None:
    silent, other = connections
    assert close_link(silent.link)
    assert silent.far.recv(1) == b""
    other.near.sendall(b"x")
    assert other.far.recv(1) == b"x"


def test_closing_does_not_wait_for_what_was_not_delivered(connections: tuple[Connection, Connection]) -> None:
    silent, _ = connections
    close_link(silent.link)
    on, seconds = silent.near.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8)[::4]
    assert (on, seconds) == (1, 0)


def test_a_link_that_is_gone_is_not_found(connections: tuple[Connection, Connection]) -> None:
    silent, _ = connections
    silent.near.close()
    assert not close_link(silent.link)


def test_a_link_has_the_congestion_control_that_this_computer_permits(
    connections: tuple[Connection, Connection],
) -> None:
    link, _ = connections
    hasten(link.link)
    used = link.near.getsockopt(socket.IPPROTO_TCP, socket.TCP_CONGESTION, 16)
    assert used.rstrip(b"\0").decode() == congestion_control()


def test_a_link_still_carries_data_after_it_was_hastened(connections: tuple[Connection, Connection]) -> None:
    link, _ = connections
    hasten(link.link)
    link.near.sendall(b"x")
    assert link.far.recv(1) == b"x"


@pytest.fixture
def unanswered() -> Iterator[socket.socket]:
    """An attempt to connect that gets no answer."""
    with ExitStack() as stack:
        listener = stack.enter_context(socket.socket())
        listener.bind(("127.0.0.1", 0))
        listener.listen(0)
        # The first one fills the queue of the listener; Linux drops the requests of further ones.
        attempts = [stack.enter_context(socket.socket()) for _ in range(3)]
        for attempt in attempts:
            attempt.setblocking(False)
            attempt.connect_ex(listener.getsockname())
        yield attempts[-1]


@pytest.mark.parametrize(
    ("missing_s", "limit_s"), [(0.0, DIAL_LIMIT_S), (3600.0, LONGEST_DIAL_S)], ids=["at_once", "far_away"]
)
def test_an_attempt_to_connect_without_an_answer_is_ended_after_its_time(
    unanswered: socket.socket, missing_s: float, limit_s: float
) -> None:
    dials = Dials()
    assert dials.abandon_lost(10.0, missing_s) == 0
    assert dials.abandon_lost(10.0 + 0.9 * limit_s, missing_s) == 0
    assert dials.abandon_lost(10.0 + 1.1 * limit_s, missing_s) >= 1
    assert dials.abandon_lost(20.0, missing_s) == 0
    assert unanswered.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) != 0
