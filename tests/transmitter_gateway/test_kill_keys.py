import os
import pty
import termios
from collections.abc import Iterator

import pytest

from rcopterx.transmitter_gateway.kill_keys import KillKeys


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[int, int]]:
    master, slave = pty.openpty()
    # A test has no controlling terminal; here it is in the foreground of this one.
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp())
    yield master, slave
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize("key", [b" ", b"k", b"K", b"xk"])
def test_space_and_k_kill_without_return(terminal: tuple[int, int], key: bytes) -> None:
    master, slave = terminal
    with KillKeys(slave) as keys:
        os.write(master, key)
        assert keys.descriptors == (slave,)
        assert keys.pressed()


@pytest.mark.parametrize("key", [b"a", b"\n", b"1"])
def test_other_keys_do_nothing(terminal: tuple[int, int], key: bytes) -> None:
    master, slave = terminal
    with KillKeys(slave) as keys:
        os.write(master, key)
        assert not keys.pressed()


def test_the_terminal_is_as_before_afterwards(terminal: tuple[int, int]) -> None:
    _, slave = terminal
    before = termios.tcgetattr(slave)
    with KillKeys(slave):
        assert not termios.tcgetattr(slave)[3] & termios.ICANON
    assert termios.tcgetattr(slave) == before


def test_without_a_terminal_nothing_is_read(terminal: tuple[int, int]) -> None:
    reader, writer = os.pipe()
    with KillKeys(reader) as keys:
        assert keys.descriptors == ()
    os.close(reader)
    os.close(writer)


def test_a_terminal_in_the_foreground_of_somebody_else_is_left_alone(
    terminal: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp() + 1)
    with KillKeys(terminal[1]) as keys:
        assert keys.descriptors == ()


def test_a_closed_terminal_is_not_waited_for_any_more(terminal: tuple[int, int]) -> None:
    master, slave = pty.openpty()
    with KillKeys(slave) as keys:
        os.close(master)
        assert not keys.pressed()
        assert keys.descriptors == ()
    os.close(slave)
