"""Promises of spares: warm before they are needed, and one more than the next death takes."""

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from support.fleets import PAIR
from support.waiting import DEADLINE_S, FakeClock, wait_for

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.deploy.processes.forking import ForkedProcess, ForkServer
from rcopterx.deploy.spares.spares import SPARES, WARMING_LIMIT_S, Spares, spare_command

# A spare imports and compiles before it is ready.
START_S = 300.0
BEATS_ONCE = """
import mmap, os, sys, time
words = memoryview(mmap.mmap(int(os.environ["RCOPTERX_HEARTBEAT"]), 4096)).cast("Q")
words[1], words[0] = int(sys.argv[1]), 1
time.sleep(600)
"""


@pytest.fixture
def forks() -> Iterator[ForkServer]:
    forks = ForkServer()
    yield forks
    forks.close()


@pytest.fixture
def spares(forks: ForkServer, tmp_path: Path) -> Iterator[Spares]:
    """One spare for the processes of a pair."""
    path = tmp_path / "lab.toml"
    path.write_text(PAIR.replace("[simulator]", '[bus]\nnamespace = "nowhere"\n[simulator]'))
    jobs = [("agent", "h1"), ("agent", "h2"), ("router", "main"), ("tracker", "main")]
    spares = Spares(forks, jobs, spare_command(path, "main", jobs), tmp_path / "spare.log", count=1)
    yield spares
    spares.close()


def always(_: int) -> bool:
    return True


@pytest.mark.timeout(600)
def test_a_spare_takes_over_once_it_is_ready_and_writes_into_the_log_of_its_predecessor(
    spares: Spares, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    log = tmp_path / "tracker.log"
    assert spares.take("tracker", "main", log, always) is None
    spares.prepare()
    spares.prepare()
    taken: list[ForkedProcess] = []

    def took_over() -> bool:
        process = spares.take("tracker", "main", log, always)
        if process is not None:
            taken.append(process)
        return process is not None

    wait_for(took_over, "the spare is never ready", deadline_s=START_S)
    try:
        wait_for(log.exists, "the log of the predecessor is not used")
        assert spares.take("tracker", "main", log, always) is None
    finally:
        end(taken[0])


def end(process: ForkedProcess) -> None:
    process.kill()
    process.wait(DEADLINE_S)


def test_a_spare_that_died_is_not_used(spares: Spares, tmp_path: Path) -> None:
    spares.prepare()
    (before,) = spares.processes
    os.kill(before, signal.SIGKILL)
    os.waitid(os.P_PID, before, os.WEXITED | os.WNOWAIT)
    assert spares.take("tracker", "main", tmp_path / "x.log", always) is None
    spares.prepare()
    assert list(spares.processes) != [before]


class WarmForks(ForkServer):
    """Starts stand-ins for spares: they sleep, and show a phase from their start on."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[ForkedProcess] = []
        self.phase = LoopPhase.WORKING

    def start(self, command: Sequence[str], log: Path, *, piped: bool = False) -> ForkedProcess:
        shows = [sys.executable, "-S", "-c", BEATS_ONCE, str(int(self.phase))]
        started = super().start(shows, log, piped=piped)
        wait_for(lambda: started.page.beats, "it does not beat")
        self.started.append(started)
        return started


@pytest.fixture
def warm() -> Iterator[WarmForks]:
    warm = WarmForks()
    yield warm
    for started in warm.started:
        end(started)
        assert started.stdin is not None
        started.stdin.close()
    warm.close()


JOBS = [("agent", "h1"), ("tracker", "main")]


def several(forks: ForkServer, directory: Path, clock: Callable[[], float] | None = None) -> Spares:
    return Spares(forks, JOBS, (), directory / "spare.log", clock=clock or FakeClock())


@pytest.mark.parametrize(("role", "successors"), [("tracker", SPARES), ("agent", SPARES - 1)])
def test_deaths_right_after_another_find_spares_and_the_last_one_is_for_what_all_vehicles_need(
    warm: WarmForks, tmp_path: Path, role: str, successors: int
) -> None:
    spares = several(warm, tmp_path)
    spares.prepare()
    assert spares.ready() == len(warm.started) == SPARES
    unit, log = dict(JOBS)[role], tmp_path / "successor.log"
    taken = [spares.take(role, unit, log, always) for _ in range(SPARES + 1)]
    assert taken == [*warm.started[:successors], *[None] * (SPARES + 1 - successors)]
    assert spares.ready() == SPARES - successors
    spares.prepare()
    assert spares.ready() == SPARES
    spares.close()


def test_a_spare_takes_no_job_it_was_not_prepared_for(warm: WarmForks, tmp_path: Path) -> None:
    spares = several(warm, tmp_path)
    spares.prepare()
    assert spares.complete
    assert spares.take("agent", "h9", tmp_path / "x.log", always) is None
    assert spares.take("transmitters", "transmitters", tmp_path / "x.log", always) is None
    assert spares.complete
    spares.close()


def test_a_spare_that_makes_no_progress_is_passed_over(warm: WarmForks, tmp_path: Path) -> None:
    spares = several(warm, tmp_path)
    spares.prepare()
    hung = warm.started[0].pid
    log = tmp_path / "tracker.log"
    taken = [spares.take("tracker", "main", log, lambda pid: pid != hung) for _ in range(SPARES)]
    assert taken == [*warm.started[1:], None]
    assert list(spares.processes) == [hung]
    spares.close()
    assert warm.started[0].returncode is not None


def test_spares_are_started_one_after_the_other(warm: WarmForks, tmp_path: Path) -> None:
    spares = several(warm, tmp_path)
    spares.prepare()
    warm.phase = LoopPhase.STARTING
    log = tmp_path / "tracker.log"
    for _ in range(2):
        assert spares.take("tracker", "main", log, always) is not None
    for _ in range(3):
        spares.prepare()
    assert len(warm.started) == SPARES + 1
    spares.close()


def test_a_spare_that_is_stopped_while_it_warms_up_keeps_no_other_one_waiting(
    warm: WarmForks, tmp_path: Path
) -> None:
    clock = FakeClock()
    spares = several(warm, tmp_path, clock)
    warm.phase = LoopPhase.STARTING
    spares.prepare()
    warm.phase = LoopPhase.WORKING
    spares.prepare()
    assert len(warm.started) == 1
    clock.advance(WARMING_LIMIT_S)
    spares.prepare()
    assert spares.ready() == SPARES - 1
    assert next(iter(spares.processes)) == warm.started[0].pid
    spares.close()


@pytest.mark.parametrize("priority", [0, 7])
def test_a_spare_begins_to_take_over_at_the_priority_it_is_given(
    warm: WarmForks, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, priority: int
) -> None:
    given = []
    # Real-time priorities are given where there is more than one processor.
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda pid, policy, param: given.append((pid, policy, param.sched_priority))
    )
    spares = Spares(warm, JOBS, (), tmp_path / "spare.log", priority=priority)
    spares.prepare()
    process = spares.take("agent", "h1", tmp_path / "agent-h1.log", always)
    assert process is not None
    of_spare = [call for call in given if call[0] == process.pid]
    assert of_spare == ([(process.pid, os.SCHED_FIFO, priority)] if priority else [])
    spares.close()


def test_a_host_without_jobs_for_spares_has_none(forks: ForkServer, tmp_path: Path) -> None:
    spares = Spares(forks, [], ["sleep", "600"], tmp_path / "spare.log")
    spares.prepare()
    assert spares.complete
    assert spares.take("agent", "h1", tmp_path / "x.log", always) is None
    assert not (tmp_path / "spare.log").exists()
