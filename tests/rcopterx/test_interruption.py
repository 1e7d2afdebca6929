"""Promises of Ctrl-C: it ends a command, without an error, whatever the command does at that moment."""

import signal
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

from rcopterx.commands.interruption import Interrupts, until_ctrl_c


class Finalized:
    """Something whose finalizer runs `action`."""

    def __init__(self, action: Callable[[], None]) -> None:
        self._action = action

    def __del__(self) -> None:
        self._action()


def press_ctrl_c() -> None:
    signal.raise_signal(signal.SIGINT)


def test_ctrl_c_ends_the_block_and_is_no_error() -> None:
    with until_ctrl_c() as interrupts:
        press_ctrl_c()
        pytest.fail("the block goes on")
    assert interrupts.is_set()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_in_a_finalizer_is_seen_by_the_loop() -> None:
    with until_ctrl_c() as interrupts:
        assert not interrupts.is_set()
        Finalized(press_ctrl_c)
        assert interrupts.is_set()


def test_block_that_ends_by_itself_was_not_interrupted() -> None:
    with until_ctrl_c() as interrupts:
        pass
    assert not interrupts.is_set()


def test_handler_of_the_program_is_restored() -> None:
    before = signal.getsignal(signal.SIGINT)
    with until_ctrl_c():
        press_ctrl_c()
    assert signal.getsignal(signal.SIGINT) is before


EVERY_MOMENT = """
import sys
from rcopterx.commands.interruption import Interrupts

for line in range(1, 50):
    interrupts, lines = Interrupts(), 0

    def trace(frame, event, argument):
        global lines
        lines += event == "line"
        if lines == line:
            sys.settrace(None)
            interrupts()
        return trace

    sys.settrace(trace)
    interrupts.wait(0.001)
    sys.settrace(None)
print(interrupts.count, interrupts.wait(0.0))
"""


def test_a_signal_at_any_moment_of_a_wait_does_not_hold_it_up() -> None:
    done = subprocess.run([sys.executable, "-c", EVERY_MOMENT], capture_output=True, text=True, timeout=60)
    assert done.stdout in ("0 False\n", "1 True\n"), done.stderr


def test_a_wait_for_signals_ends_at_the_first_or_after_its_time() -> None:
    interrupts = Interrupts()
    assert not interrupts.wait(0.001)
    threading.Timer(0.05, interrupts).start()
    assert interrupts.wait(60.0)
    interrupts()
    assert (interrupts.count, interrupts.wait(60.0)) == (2, True)
