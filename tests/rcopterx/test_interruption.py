"""Promises of Ctrl-C: it ends a command, without an error, whatever the command does at that moment."""

import signal
from collections.abc import Callable

import pytest

from rcopterx.commands.interruption import until_ctrl_c


class Finalized:
    """Something whose finalizer runs `action`."""

    def __init__(self, action: Callable[[], None]) -> None:
        self._action = action

    def __del__(self) -> None:
        self._action()


def press_ctrl_c() -> None:
    signal.raise_signal(signal.SIGINT)


def test_ctrl_c_ends_the_block_and_is_no_error() -> None:
    with until_ctrl_c() as interruption:
        press_ctrl_c()
        pytest.fail("the block goes on")
    assert interruption.pressed


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_in_a_finalizer_is_seen_by_the_loop() -> None:
    with until_ctrl_c() as interruption:
        assert not interruption.pressed
        Finalized(press_ctrl_c)
        assert interruption.pressed


def test_block_that_ends_by_itself_was_not_interrupted() -> None:
    with until_ctrl_c() as interruption:
        pass
    assert not interruption.pressed


def test_handler_of_the_program_is_restored() -> None:
    before = signal.getsignal(signal.SIGINT)
    with until_ctrl_c():
        press_ctrl_c()
    assert signal.getsignal(signal.SIGINT) is before
