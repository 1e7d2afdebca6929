"""Promises of spare processes: warm before they are needed, and one more than the next death takes."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from support.fleets import PAIR
from support.waiting import DEADLINE_S, FakeClock, wait_for

from rcopterx.bus.heartbeat import Phase
from rcopterx.deploy.processes.forking import ForkServer, Started
from rcopterx.deploy.spares.spare_process import SPARES, WARMING_LIMIT_S, SpareProcess, SpareProcesses

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
def spare(forks: ForkServer, tmp_path: Path) -> Iterator[SpareProcess]:
    path = tmp_path / "lab.toml"
    path.write_text(PAIR.replace("[simulator]", '[bus]\nnamespace = "nobody"\n[simulator]'))
    agent = SpareProcess(
        path,
        [("agent", "h1"), ("agent", "h2"), ("router", "main"), ("tracker", "main")],
        tmp_path / "spare.log",
        forks,
    )
    yield agent
    agent.close()


@pytest.mark.timeout(600)
def test_a_spare_takes_over_once_it_is_ready_and_writes_into_the_agents_log(
    spare: SpareProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    log = tmp_path / "agent-h2.log"
    assert spare.take("agent", "h2", log) is None
    spare.prepare()
    spare.prepare()
    taken = []

    def took_over() -> bool:
        started = spare.take("agent", "h2", log)
        if started is not None:
            taken.append(started)
        return started is not None

    wait_for(took_over, "the spare is never ready", deadline_s=START_S)
    process = taken[0].process
    try:
        wait_for(log.exists, "the log of the agent is not used")
        assert spare.take("agent", "h1", log) is None
    finally:
        process.kill()
        process.wait(DEADLINE_S)


@pytest.mark.timeout(600)
def test_a_spare_takes_no_job_it_was_not_prepared_for(spare: SpareProcess, tmp_path: Path) -> None:
    spare.prepare()
    wait_for(spare.ready, "the spare is never ready", deadline_s=START_S)
    assert spare.take("agent", "h9", tmp_path / "x.log") is None
    assert spare.take("transmitters", "transmitters", tmp_path / "x.log") is None
    assert spare.ready()


def test_a_spare_that_died_is_not_used(spare: SpareProcess, tmp_path: Path) -> None:
    spare.prepare()
    before = spare.started
    assert before is not None
    before.process.kill()
    before.process.wait(DEADLINE_S)
    assert spare.take("agent", "h1", tmp_path / "x.log") is None
    spare.prepare()
    assert spare.started is not before


class WarmForks(ForkServer):
    """Starts stand-ins for spare processes: they sleep, ready from their start on unless told otherwise."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[Started] = []
        self.phase = Phase.WORKING

    def start(self, command: Sequence[str], log: Path, *, piped: bool = False) -> Started:
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
        started.process.kill()
        started.process.wait(DEADLINE_S)
        assert started.process.stdin is not None
        started.process.stdin.close()
    warm.close()


JOBS = [("agent", "h1"), ("tracker", "main")]


def several(forks: ForkServer, directory: Path, clock: Callable[[], float] | None = None) -> SpareProcesses:
    clock = clock or FakeClock()
    return SpareProcesses(
        SpareProcess(directory / "lab.toml", JOBS, directory / "spare.log", forks, clock=clock)
        for _ in range(SPARES)
    )


@pytest.mark.parametrize(("role", "successors"), [("tracker", SPARES), ("agent", SPARES - 1)])
def test_deaths_right_after_another_find_spares_and_the_last_one_is_for_what_everybody_needs(
    warm: WarmForks, tmp_path: Path, role: str, successors: int
) -> None:
    spares = several(warm, tmp_path)
    spares.prepare()
    assert spares.ready() == len(warm.started) == SPARES
    unit, log = dict(JOBS)[role], tmp_path / "successor.log"
    taken = [spares.take(role, unit, log, lambda _: True) for _ in range(SPARES + 1)]
    assert taken == [*warm.started[:successors], *[None] * (SPARES + 1 - successors)]
    assert spares.ready() == SPARES - successors
    spares.prepare()
    assert spares.ready() == SPARES
    spares.close()


def test_a_spare_that_makes_no_progress_is_passed_over(warm: WarmForks, tmp_path: Path) -> None:
    spares = several(warm, tmp_path)
    spares.prepare()
    hung = warm.started[0].process.pid
    log = tmp_path / "tracker.log"
    taken = [spares.take("tracker", "main", log, lambda pid: pid != hung) for _ in range(SPARES)]
    assert taken == [*warm.started[1:], None]
    assert list(spares.pages) == [hung]
    spares.close()
    assert warm.started[0].process.returncode is not None


def test_spares_are_started_one_after_the_other(warm: WarmForks, tmp_path: Path) -> None:
    spares = several(warm, tmp_path)
    spares.prepare()
    warm.phase = Phase.STARTING
    log = tmp_path / "tracker.log"
    for _ in range(2):
        assert spares.take("tracker", "main", log, lambda _: True) is not None
    for _ in range(3):
        spares.prepare()
    assert len(warm.started) == SPARES + 1
    spares.close()


def test_a_spare_that_is_stopped_while_it_warms_up_keeps_no_other_one_waiting(
    warm: WarmForks, tmp_path: Path
) -> None:
    clock = FakeClock()
    spares = several(warm, tmp_path, clock)
    warm.phase = Phase.STARTING
    spares.prepare()
    warm.phase = Phase.WORKING
    spares.prepare()
    assert len(warm.started) == 1
    clock.advance(WARMING_LIMIT_S)
    spares.prepare()
    assert spares.ready() == SPARES - 1
    assert next(iter(spares.pages)) == warm.started[0].process.pid
    spares.close()


@pytest.mark.parametrize("asked", [0, 7])
def test_a_spare_begins_to_take_over_at_the_priority_it_is_given(
    warm: WarmForks, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: int
) -> None:
    given = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda pid, policy, param: given.append((pid, policy, param.sched_priority))
    )
    spare = SpareProcess(tmp_path / "lab.toml", JOBS, tmp_path / "spare.log", warm, priority=asked)
    spare.prepare()
    started = spare.take("agent", "h1", tmp_path / "agent-h1.log")
    assert started is not None
    assert given == ([(started.process.pid, os.SCHED_FIFO, asked)] if asked else [])


def test_a_host_without_jobs_for_it_has_no_spare(forks: ForkServer, tmp_path: Path) -> None:
    spare = SpareProcess(tmp_path / "lab.toml", [], tmp_path / "spare.log", forks)
    spare.prepare()
    assert spare.take("agent", "h1", tmp_path / "x.log") is None
    assert not (tmp_path / "spare.log").exists()
    spare.close()
