"""Promises of the supervisor about processes that hang or get no processor."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from support.supervised import (
    LIMITS,
    READING_S,
    Supervise,
    beating,
    beats_of,
    kill,
    watch_until,
)
from support.waiting import DEADLINE_S, FakeClock, PatientClock, wait_for

from rcopterx.fleet.schema import WatchdogConfig


def may_be_real_time() -> bool:
    """Whether processes started here may have real-time priorities, and leave other processes a processor."""
    code = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))"
    tried = subprocess.run([sys.executable, "-c", code], check=False, stderr=subprocess.DEVNULL)
    return tried.returncode == 0 and len(os.sched_getaffinity(0)) > 1


def test_a_process_that_is_stopped_is_replaced_reported_and_counted(supervise: Supervise) -> None:
    clock = FakeClock()
    supervisor = supervise(beating("one"), beating("two"), watchdog=LIMITS, clock=clock)
    supervisor.start_all()
    watch_until(supervisor, lambda: all(beats_of(supervisor, name) for name in ("one", "two")), "no beats")
    other, before = supervisor.pid("two"), kill(supervisor, "one", signal.SIGSTOP)
    lines: list[str] = []
    while supervisor.children["one"].restarts == 0:
        beats = beats_of(supervisor, "two")
        wait_for(lambda beats=beats: beats_of(supervisor, "two") > beats, "the other one makes no progress")
        clock.advance(READING_S)
        lines += supervisor.watch(0.0)
        assert clock() < 200.0, "not replaced"
    assert re.match(
        r"one: hung: no progress for 0\.\d\d s, 0\.5 s are allowed; killed by SIGKILL; log: ", lines[0]
    )
    assert supervisor.pid("one") != before
    assert supervisor.pid("two") == other
    assert (supervisor.children["one"].hung, supervisor.children["two"].hung) == (1, 0)
    watch_until(supervisor, lambda: beats_of(supervisor, "one"), "the successor shows no progress")


@pytest.mark.timeout(400)
@pytest.mark.parametrize(
    "how", [(), pytest.param(("in real time",), marks=pytest.mark.campaign)], ids=["normal", "real time"]
)
def test_a_process_that_spins_is_replaced(supervise: Supervise, how: tuple[str, ...]) -> None:
    if how and not may_be_real_time():
        pytest.skip("no right to real-time priorities")
    # A supervisor that gets no processor itself forgives all processes.
    clock = PatientClock(READING_S)
    supervisor = supervise(beating("one", "spins", *how), watchdog=LIMITS, clock=clock)
    supervisor.start_all()
    replaced = watch_until(
        supervisor, lambda: supervisor.children["one"].restarts == 1, "not replaced", deadline_s=300.0
    )
    assert "one: hung: no progress for" in replaced[0]


@contextmanager
def starved(process: int) -> Iterator[None]:
    """Leave a process hardly any processor time."""
    processor = min(os.sched_getaffinity(0))
    spins = f"import os\nos.sched_setaffinity(0, {{{processor}}})\nwhile True: pass"
    os.sched_setaffinity(process, {processor})
    os.setpriority(os.PRIO_PROCESS, process, 19)
    # Linux shares processors among sessions first.
    with suppress(OSError):
        Path(f"/proc/{process}/autogroup").write_text("19", encoding="ascii")
    command = [sys.executable, "-S", "-c", spins]
    spinning = [subprocess.Popen(command, start_new_session=True) for _ in range(3)]
    try:
        yield
    finally:
        for program in spinning:
            program.kill()
            program.wait()


@pytest.mark.parametrize("pause_s", [0.01, 0.06], ids=["checked in time", "checked late"])
def test_a_process_that_gets_no_processor_is_waited_for(supervise: Supervise, pause_s: float) -> None:
    supervisor = supervise(
        beating("one", "works"),
        *(beating(name) for name in ("two", "three", "four")),
        watchdog=WatchdogConfig(flight_s=0.15, floor_s=0.15, start_s=60.0),
    )
    supervisor.start_all()
    watch_until(supervisor, lambda: beats_of(supervisor, "one"), "no beats")
    pid = supervisor.pid("one")
    assert pid is not None
    with starved(pid):
        end_s = time.monotonic() + DEADLINE_S
        while supervisor.longest_silence_s("one") < 0.6:
            time.sleep(pause_s)
            lines = supervisor.watch(0.0)
            assert not any(line.startswith("one: ") for line in lines)
            assert time.monotonic() < end_s, f"not starved: {supervisor.longest_silence_s('one')} s"
    watch_until(supervisor, lambda: supervisor.watchdog.forgiven.get("load", 0) > 0, "it does not go on")
    assert supervisor.pid("one") == pid


def test_without_a_watchdog_a_process_may_be_stopped(supervise: Supervise) -> None:
    supervisor = supervise(beating("one"))
    supervisor.start_all()
    watch_until(supervisor, lambda: beats_of(supervisor, "one"), "no beats")
    pid = kill(supervisor, "one", signal.SIGSTOP)
    stopped_s = time.monotonic()
    watch_until(supervisor, lambda: time.monotonic() > stopped_s + 2 * LIMITS.floor_s, "no time passes")
    assert supervisor.pid("one") == pid
    assert not supervisor.watchdog_on
    kill(supervisor, "one")


def test_the_longest_silence_of_a_process_is_known(supervise: Supervise) -> None:
    supervisor = supervise(
        beating("one"), watchdog=WatchdogConfig(flight_s=DEADLINE_S, floor_s=DEADLINE_S, start_s=DEADLINE_S)
    )
    supervisor.start_all()
    watch_until(supervisor, lambda: beats_of(supervisor, "one"), "no beats")
    pid = kill(supervisor, "one", signal.SIGSTOP)
    watch_until(supervisor, lambda: supervisor.longest_silence_s("one") > 0.1, "not noticed")
    os.kill(pid, signal.SIGCONT)
    before = beats_of(supervisor, "one")
    watch_until(supervisor, lambda: beats_of(supervisor, "one") > before, "it does not go on")
    assert supervisor.children["one"].hung == 0
    assert supervisor.longest_silence_s("one") > 0.1
