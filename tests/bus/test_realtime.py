"""What real-time processes are kept from."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import pytest

from rcopterx.bus import realtime

NOT_PERMITTED: Final = 77
IN_REALTIME: Final = """
import os, threading, time
from rcopterx.bus.realtime import request_realtime
threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
print(request_realtime(1))
threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
print(os.sched_getscheduler(0) == os.SCHED_FIFO, flush=True)
time.sleep(60)
"""
SPINNING: Final = f"""
import sys, time
from rcopterx.bus import realtime
realtime.SPIN_LIMIT_S = 0.2
if not realtime.request_realtime(1):
    sys.exit({NOT_PERMITTED})
if sys.argv[1] == "sleeps":
    for _ in range(40):
        until_s = time.monotonic() + 0.01
        while time.monotonic() < until_s:
            pass
        time.sleep(0.001)
    sys.exit(0)
until_s = time.monotonic() + 20.0
while time.monotonic() < until_s:
    pass
"""


def ended(what: str) -> int:
    code = subprocess.run([sys.executable, "-c", SPINNING, what], timeout=300, check=False).returncode
    if code == NOT_PERMITTED:
        pytest.skip("no right to real-time priorities")
    return code


def test_the_kernel_ends_a_real_time_process_that_spins() -> None:
    assert -ended("spins") in (signal.SIGXCPU, signal.SIGKILL)


def test_a_real_time_process_that_sleeps_in_between_may_work_longer_than_that() -> None:
    assert ended("sleeps") == 0


def test_a_program_that_shares_its_interpreter_collects_no_garbage_of_before() -> None:
    program = """
import gc, sys
from rcopterx.bus.realtime import SWITCH_INTERVAL_S, share_interpreter
share_interpreter()
assert gc.isenabled() and gc.get_freeze_count() > 1000
assert sys.getswitchinterval() == SWITCH_INTERVAL_S
"""
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


@contextmanager
def in_realtime(processors: set[int]) -> Iterator[tuple[int, list[str]]]:
    """Run a process with several threads that requests a priority; give its id and what it printed."""
    command = [sys.executable, "-c", IN_REALTIME]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, preexec_fn=lambda: os.sched_setaffinity(0, processors)
    ) as process:
        assert process.stdout is not None
        try:
            yield process.pid, [process.stdout.readline().strip() for _ in range(2)]
        finally:
            process.kill()


def test_no_process_enters_the_real_time_class_where_only_one_processor_can_be_used() -> None:
    with in_realtime({min(os.sched_getaffinity(0))}) as (_, printed):
        assert printed == ["False", "False"]


def test_all_threads_of_another_process_leave_the_real_time_class() -> None:
    with in_realtime(os.sched_getaffinity(0)) as (pid, printed):
        if printed != ["True", "True"]:
            pytest.skip("no right to real-time priorities")
        threads = [int(name) for name in os.listdir(f"/proc/{pid}/task")]
        assert {os.sched_getscheduler(thread) for thread in threads} == {os.SCHED_OTHER, os.SCHED_FIFO}
        realtime.leave_realtime(threads)
        assert {os.sched_getscheduler(thread) for thread in threads} == {os.SCHED_OTHER}
