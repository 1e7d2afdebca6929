"""Promises of callbacks on Zenoh's threads and of what they wake."""

import threading
from collections.abc import Callable

from support.waiting import wait_for

from rcopterx.bus import channels
from rcopterx.bus.messages import Kill
from rcopterx.bus.receiving import Wake
from rcopterx.bus.session import Heard, Session


def test_the_state_of_a_receiving_thread_outlives_a_callback(join: Callable[..., Session]) -> None:
    sender, receiver = join(), join()
    of_thread = threading.local()
    numbers: list[int] = []

    def hear(_: Heard) -> None:
        # Lost with the state of the thread.
        of_thread.count = getattr(of_thread, "count", 0) + 1
        numbers.append(of_thread.count)

    receiver.tap(hear)

    def heard_again() -> bool:
        sender.publish(channels.KILL, "fleet", Kill(source="gcs", reason="test"))
        return max(numbers, default=0) >= 3

    wait_for(heard_again, "every callback has a new state of its thread")


def test_a_loop_is_woken_once_however_often_it_was_asked_to_wake() -> None:
    wake = Wake()
    for _ in range(3):
        wake.set()
    assert wake.wait(0.0)
    assert not wake.wait(0.0)


def test_a_loop_that_waits_is_woken_by_another_thread() -> None:
    wake, woken = Wake(), []
    waiting = threading.Thread(target=lambda: woken.append(wake.wait(60.0)), daemon=True)
    waiting.start()
    wake.set()
    waiting.join(60.0)
    assert woken == [True]
