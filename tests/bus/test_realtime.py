"""What real-time processes are kept from."""

import signal
import subprocess
import sys
from typing import Final

import pytest

NOT_PERMITTED: Final = 77
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
