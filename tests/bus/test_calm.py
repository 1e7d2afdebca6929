"""Promises of the calm part of a frame's period."""

import math
import subprocess
import sys
from typing import Final

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rcopterx.bus.calm import BUSY_SHARE, CALM_UNTIL_SHARE, LONGEST_PERIOD_S, CalmWait, calm_at_s
from rcopterx.bus.realtime import own_priority
from rcopterx.bus.receiving import Wake

TIMES = st.floats(0.0, 1e5)
NOT_PERMITTED: Final = 77
CALM: Final = f"""
import os, sys, threading, time
from rcopterx.bus.calm import LONGEST_CALM_S, CalmWait
from rcopterx.bus.realtime import own_priority, request_realtime
from rcopterx.bus.receiving import Wake
if not request_realtime(5):
    sys.exit({NOT_PERMITTED})
now_s, wake, calm = 0.0, Wake(), CalmWait(2, lambda: now_s)
after = []

def work():
    calm.wait(wake, 60.0)
    after.append(own_priority())

def priority_until(expected):
    until_s = time.monotonic() + 20.0
    while time.monotonic() < until_s:
        if os.sched_getparam(thread.native_id).sched_priority == expected:
            return True
        time.sleep(0.001)

thread = threading.Thread(target=work)
thread.start()
assert priority_until(2), "waits at its own priority"
now_s = 60.0 + LONGEST_CALM_S / 2
calm.hurry()
assert os.sched_getparam(thread.native_id).sched_priority == 2, "hurries too early"
now_s = 60.0 + 2 * LONGEST_CALM_S
calm.hurry()
assert os.sched_getparam(thread.native_id).sched_priority == 5, "does not hurry"
wake.set()
thread.join()
assert after == [5], "works at another priority"
"""


@given(due_s=TIMES, arrived_s=TIMES, period_s=st.floats(0.002, LONGEST_PERIOD_S))
def test_what_can_wait_is_done_in_the_calm_part_of_a_period_soon(
    due_s: float, arrived_s: float, period_s: float
) -> None:
    at_s = calm_at_s(due_s, arrived_s, period_s)
    tolerance_s = 1e-9
    longest_s = (1.0 - CALM_UNTIL_SHARE + BUSY_SHARE) * period_s
    assert due_s <= at_s <= due_s + longest_s + tolerance_s
    into_s = (at_s - arrived_s) % period_s
    assert BUSY_SHARE * period_s - tolerance_s <= into_s <= CALM_UNTIL_SHARE * period_s + tolerance_s


@given(due_s=TIMES, arrived_s=TIMES, period_s=st.floats(0.002, LONGEST_PERIOD_S))
def test_what_is_due_in_the_calm_part_is_done_at_once(
    due_s: float, arrived_s: float, period_s: float
) -> None:
    into = (due_s - arrived_s) % period_s / period_s
    assume(min(abs(into - BUSY_SHARE), abs(into - CALM_UNTIL_SHARE)) > 1e-6)
    assert (calm_at_s(due_s, arrived_s, period_s) == due_s) == (BUSY_SHARE < into < CALM_UNTIL_SHARE)


@pytest.mark.parametrize(
    ("due_s", "arrived_s", "period_s"),
    [
        (5.0, None, 0.0),
        (5.0, 5.0, 0.0),
        (5.0, 5.0, 2 * LONGEST_PERIOD_S),
        (5.0, 5.0, math.nan),
        (-math.inf, 5.0, 0.02),
    ],
)
def test_without_a_steady_motion_capture_or_in_a_hurry_nothing_waits(
    due_s: float, arrived_s: float | None, period_s: float
) -> None:
    assert calm_at_s(due_s, arrived_s, period_s) == due_s


def test_a_calm_wait_is_at_a_low_priority_until_it_is_over_or_long_overdue() -> None:
    code = subprocess.run([sys.executable, "-c", CALM], timeout=300, check=False).returncode
    if code == NOT_PERMITTED:
        pytest.skip("no right to real-time priorities")
    assert code == 0


def test_without_real_time_a_calm_wait_is_a_wait() -> None:
    wake, calm = Wake(), CalmWait(2, lambda: 0.0)
    assert not calm.wait(wake, 0.0)
    wake.set()
    assert calm.wait(wake, 60.0)
    calm.hurry()
    assert own_priority() == 0
