import os
import threading
import time
from collections.abc import Iterator

import pytest

from rcopterx.bus.clock import Clock
from rcopterx.bus.wakeup import Wakeup

LONG_S = 600.0
"""Longer than any test may take: a wait that does not end fails."""


@pytest.fixture
def wakeup() -> Iterator[Wakeup]:
    wakeup = Wakeup()
    yield wakeup
    wakeup.close()


def test_notification_before_the_wait_ends_it_at_once_and_only_once(wakeup: Wakeup) -> None:
    wakeup.notify()
    reader, writer = os.pipe()
    assert wakeup.wait(LONG_S, [reader]) == set()
    os.write(writer, b"x")
    assert wakeup.wait(LONG_S, [reader]) == {reader}
    os.close(reader)
    os.close(writer)


def test_burst_of_notifications_is_one_and_the_next_one_wakes_again(wakeup: Wakeup) -> None:
    reader, writer = os.pipe()
    os.write(writer, b"x")
    for _ in range(3):
        for _ in range(5):
            wakeup.notify()
        assert wakeup.wait(LONG_S) == set()
        assert wakeup.wait(LONG_S, [reader]) == {reader}
    os.close(reader)
    os.close(writer)


def test_notification_from_another_thread_while_it_waits(wakeup: Wakeup) -> None:
    timer = threading.Timer(0.05, wakeup.notify)
    timer.start()
    assert wakeup.wait(LONG_S) == set()
    timer.join()


def test_notification_between_waking_up_and_reading_is_not_lost(
    wakeup: Wakeup, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is either seen by the reader, who reads after the wait, or wakes the next wait."""
    stored: list[int] = []
    seen: list[int] = []
    read = os.eventfd_read

    def store(number: int) -> None:
        stored.append(number)
        wakeup.notify()

    def read_late(descriptor: int) -> int:
        store(2)
        value = read(descriptor)
        store(3)
        return value

    monkeypatch.setattr(os, "eventfd_read", read_late)
    store(1)
    wakeup.wait(LONG_S)
    seen += stored
    monkeypatch.undo()
    store(4)
    wakeup.wait(LONG_S)
    assert seen == [1, 2, 3]
    assert stored == [1, 2, 3, 4]


def test_in_slow_motion_a_wait_takes_longer() -> None:
    wakeup = Wakeup(Clock(0.1))
    before_s = time.monotonic()
    assert wakeup.wait(0.005) == set()
    assert time.monotonic() - before_s >= 0.05
    wakeup.close()
