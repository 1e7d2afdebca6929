"""Faults of real processes begin and end as ordered."""

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from types import SimpleNamespace

import pytest
from support.waiting import DEADLINE_S, wait_for

from rcopterx.bus.clock import Clock
from rcopterx.ground_station.scripting.waiting import NotReachedError
from rcopterx_studies.benchmarks.processes import cpu_s
from rcopterx_studies.faults.bench import Bench
from rcopterx_studies.faults.host_injectors import (
    ClockStepped,
    DiskFull,
    FleetFileBroken,
    LogsGone,
    NoDescriptors,
)
from rcopterx_studies.faults.orders import VARIABLE, give_order, obedient_processes
from rcopterx_studies.faults.process_injectors import (
    DiesAtStart,
    Halting,
    Killed,
    Pair,
    Slow,
    Spinning,
    Starved,
    Stopped,
)

LOOP = """
import sys, time
from rcopterx.bus.heartbeat import Heartbeat
heartbeat = Heartbeat(bytearray(32))
print("ready", flush=True)
for line in sys.stdin:
    before = time.monotonic()
    heartbeat.beat()
    print(time.monotonic() - before, time.time(), flush=True)
"""


class OneProcess:
    """Stands for a supervisor: starts a process again as soon as it has ended."""

    def __init__(self, command: list[str]) -> None:
        self._command = command
        self.processes = [self._started()]
        self.kept = True
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _started(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def _run(self) -> None:
        while not self._over.wait(0.002):
            if self.processes[-1].poll() is not None:
                self.processes.append(self._started())

    def pid(self, name: str) -> int | None:
        return self.processes[-1].pid if name == "it" else None

    @property
    def children(self) -> dict[str, SimpleNamespace]:
        return {"it": SimpleNamespace(spec=SimpleNamespace(role="agent"))}

    spares = SimpleNamespace(processes=())

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        for process in self.processes:
            process.kill()
            process.wait(DEADLINE_S)
            for pipe in (process.stdin, process.stdout):
                assert pipe is not None
                pipe.close()


Start = Callable[[list[str]], tuple[Bench, OneProcess]]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    with ExitStack() as stack:

        def started(command: list[str]) -> tuple[Bench, OneProcess]:
            supervisor = OneProcess(command)
            stack.callback(supervisor.close)
            launcher = SimpleNamespace(supervisor=supervisor, directory=tmp_path)
            file, session = SimpleNamespace(clock=Clock()), SimpleNamespace(clock=time.monotonic)
            fleet = SimpleNamespace(launcher=launcher, file=file, session=session)
            return Bench(fleet, lambda _: None, time.sleep, tmp_path / "lab.toml"), supervisor  # type: ignore[arg-type]  # a partial stand-in

        yield started


SLEEPS = ["sleep", "600"]


def state_of(pid: int) -> str:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]


def affinities_of(pid: int) -> set[frozenset[int]]:
    tasks = os.listdir(f"/proc/{pid}/task")
    return {frozenset(os.sched_getaffinity(int(task))) for task in tasks}


def test_a_starved_process_may_use_one_processor_only_until_it_is_over(start: Start) -> None:
    bench, supervisor = start(SLEEPS)
    pid, processors = bench.pid("it"), os.sched_getaffinity(0)
    seen = set()

    def say(_: str) -> None:
        seen.update(affinities_of(pid))

    with Starved("it").active(replace(bench, say=say)):
        assert affinities_of(pid) == {frozenset(processors)}
    assert seen == {frozenset({min(processors)})}
    assert supervisor.pid("it") == pid


def test_the_second_fault_of_a_pair_comes_after_the_first_one_and_hits_the_successor(start: Start) -> None:
    bench, supervisor = start(SLEEPS)
    waits: list[float] = []

    def wait(seconds: float) -> None:
        waits.append(seconds)
        time.sleep(seconds)

    with Pair(Killed("it"), Killed("it"), 0.04).active(replace(bench, wait=wait)):
        wait_for(lambda: len(supervisor.processes) == 3, "not killed twice")
    assert waits[0] == 0.04
    assert [process.returncode for process in supervisor.processes[:2]] == [-signal.SIGKILL] * 2


def test_a_pair_of_which_a_fault_is_not_possible_shows_that(start: Start) -> None:
    bench, _ = start(SLEEPS)
    for first, second in (("other", "it"), ("it", "other")):
        with pytest.raises(NotReachedError, match="other does not run"):
            Pair(Killed(first), Stopped(second, 0.01), 0.0).active(bench).__enter__()


def test_what_was_reached_for_a_moment_counts_as_reached(start: Start) -> None:
    bench, _ = start(SLEEPS)
    looks = iter([False, True])
    assert bench.wait_for(lambda: next(looks), 10.0)
    assert not bench.wait_for(lambda: False, 0.02)


def test_a_killed_process_is_gone(start: Start) -> None:
    bench, supervisor = start(SLEEPS)
    with Killed("it").active(bench):
        wait_for(lambda: len(supervisor.processes) == 2, "it was not killed")


def test_a_stopped_process_goes_on_after_its_time(start: Start) -> None:
    bench, supervisor = start(SLEEPS)
    pid = supervisor.processes[0].pid
    started_s = time.monotonic()
    with Stopped("it", 0.1).active(bench):
        assert time.monotonic() - started_s >= 0.1
        wait_for(lambda: state_of(pid) == "S", "it is still stopped")
    assert len(supervisor.processes) == 1


def test_a_stopped_process_that_is_replaced_is_waited_for_no_longer(start: Start) -> None:
    bench, supervisor = start(SLEEPS)
    waits_s: list[float] = []

    def killed(seconds: float) -> None:
        waits_s.append(seconds)
        supervisor.processes[0].kill()
        wait_for(lambda: len(supervisor.processes) == 2, "it is not replaced")

    with Stopped("it", 300.0).active(replace(bench, wait=killed)):
        assert sum(waits_s) < 100.0


def test_a_process_that_is_stopped_again_and_again_goes_on_afterwards(start: Start) -> None:
    bench, supervisor = start(SLEEPS)
    pid, states = supervisor.processes[0].pid, set()
    phases = cycle("TS")

    def looked(_: float) -> None:
        phase = next(phases)
        wait_for(lambda: state_of(pid) == phase, f"it is not {phase}")
        states.add(phase)

    with Halting("it", 0.005, 0.01, 0.3).active(replace(bench, wait=looked)):
        wait_for(lambda: state_of(pid) == "S", "it is still stopped")
    assert "T" in states


def test_a_crash_loop_may_end_by_itself(start: Start) -> None:
    bench, supervisor = start(SLEEPS)

    def some_died(_: float) -> None:
        wait_for(lambda: len(supervisor.processes) > 2, "they do not die")

    with DiesAtStart("it", None, 0.1).active(replace(bench, wait=some_died)):
        wait_for(lambda: supervisor.processes[-1].poll() is None, "no process survives")


def test_a_number_of_successors_dies_at_its_start_and_the_next_one_lives(start: Start) -> None:
    bench, supervisor = start(SLEEPS)
    with DiesAtStart("it", 2).active(bench):
        wait_for(lambda: len(supervisor.processes) == 4, "not as many were killed")
        assert supervisor.processes[-1].poll() is None


def test_every_successor_dies_until_the_crash_loop_ends(start: Start) -> None:
    bench, supervisor = start(SLEEPS)
    with DiesAtStart("it", None).active(bench):
        wait_for(lambda: len(supervisor.processes) > 5, "a process survives")
    last = supervisor.processes[-1]
    wait_for(lambda: supervisor.processes[-1].poll() is None, "no process survives")
    assert supervisor.processes.index(last) >= 4


def ask(process: subprocess.Popen[bytes]) -> list[float]:
    """Let the loop go round once: how long a beat took, and the wall clock."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(b"\n")
    process.stdin.flush()
    return [float(word) for word in process.stdout.readline().split()]


@pytest.fixture
def obedient(start: Start) -> Iterator[tuple[Bench, OneProcess]]:
    with obedient_processes():
        bench, supervisor = start([sys.executable, "-c", LOOP])
        ready(supervisor)
        yield bench, supervisor


def ready(supervisor: OneProcess) -> None:
    stdout = supervisor.processes[-1].stdout
    assert stdout is not None
    assert stdout.readline() == b"ready\n"


def test_processes_get_slow_spin_and_show_another_time_from_inside(
    obedient: tuple[Bench, OneProcess],
) -> None:
    bench, supervisor = obedient
    process = supervisor.processes[0]
    with ClockStepped(-3600.0).active(bench), Slow("it", 0.05, 0.1).active(bench):
        wait_for(lambda: abs(ask(process)[1] + 3600.0 - time.time()) < 60.0, "the clock is right")
    with Slow("it", 0.05, 0.0).active(bench):
        wait_for(lambda: ask(process)[0] < 0.04, "it is slow for ever")

    def killed(_: float) -> None:
        used_s = cpu_s(process.pid)
        wait_for(lambda: cpu_s(process.pid) > used_s, "it does not spin")
        process.kill()
        wait_for(lambda: supervisor.processes[-1] is not process, "it is not replaced")

    with Spinning("it").active(replace(bench, wait=killed)):
        assert process.wait(DEADLINE_S) < 0


def test_a_slow_process_takes_longer_for_every_turn(obedient: tuple[Bench, OneProcess]) -> None:
    _, supervisor = obedient
    process = supervisor.processes[0]
    wait_for(lambda: ask(process)[0] < 0.03, "it is slow without an order")
    give_order(process.pid, "slow", by_s=0.03, seconds=60.0)
    wait_for(lambda: ask(process)[0] >= 0.03, "it is not slow")


FORKS = """
import os, sys, time
child = os.fork()
if child:
    print(child, flush=True)
    os.waitpid(child, 0)
else:
    for line in sys.stdin:
        print(time.time(), flush=True)
"""


def test_a_process_that_was_forked_takes_orders_of_its_own() -> None:
    words = [sys.executable, "-c", FORKS]
    with (
        obedient_processes(),
        subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent,
    ):
        assert parent.stdin is not None
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        wait_for(Path(os.environ[VARIABLE], str(pid)).exists, "it takes no orders")
        give_order(pid, "step_clock", offset_s=-3600.0)
        parent.stdin.write(b"\n")
        parent.stdin.flush()
        assert abs(float(parent.stdout.readline()) + 3600.0 - time.time()) < 60.0


def test_a_process_that_takes_no_orders_is_not_ended_by_one(start: Start) -> None:
    bench, supervisor = start(SLEEPS)
    with pytest.raises(NotReachedError, match="takes no orders"), Spinning("it").active(bench):
        pass
    with obedient_processes(), pytest.raises(NotReachedError, match="takes no orders"):
        give_order(supervisor.processes[0].pid, "spin", seconds=1.0)
    assert supervisor.processes[0].poll() is None


def test_the_environment_is_as_before_when_no_more_orders_are_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    with obedient_processes():
        assert os.environ["PYTHONPATH"].endswith("inside")
        assert Path(os.environ[VARIABLE]).is_dir()
    assert VARIABLE not in os.environ
    assert "PYTHONPATH" not in os.environ


OPENS = """
import sys
for line in sys.stdin:
    try:
        with open(sys.argv[1], "a") as file:
            file.write("x")
        print("ok", flush=True)
    except OSError as error:
        print(error.errno, flush=True)
"""


def answer(supervisor: OneProcess) -> str:
    """Let the process try to open and write its file."""
    process = supervisor.processes[0]
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(b"\n")
    process.stdin.flush()
    return process.stdout.readline().decode().strip()


def test_a_process_without_descriptors_can_open_nothing_until_it_is_over(
    start: Start, tmp_path: Path
) -> None:
    bench, supervisor = start([sys.executable, "-c", OPENS, str(tmp_path / "file")])
    assert answer(supervisor) == "ok"
    with NoDescriptors("it").active(bench):
        assert answer(supervisor) == str(errno.EMFILE)
    assert answer(supervisor) == "ok"


def test_on_a_full_disk_no_file_grows(start: Start, tmp_path: Path) -> None:
    bench, supervisor = start([sys.executable, "-c", OPENS, str(tmp_path / "file")])
    with DiskFull().active(bench):
        assert answer(supervisor) == str(errno.EFBIG)
    assert (tmp_path / "file").read_text() == ""


def test_the_fleet_file_and_the_logs_are_as_before_afterwards(start: Start, tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text("name = 'lab'\n")
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "agent-h1.log").write_text("hello")
    bench, _ = start(SLEEPS)
    with FleetFileBroken().active(bench), LogsGone().active(bench):
        assert (tmp_path / "lab.toml").read_text() == "name = [\n"
        assert (tmp_path / "log").is_file()
    assert (tmp_path / "lab.toml").read_text() == "name = 'lab'\n"
    assert (tmp_path / "log" / "agent-h1.log").read_text() == "hello"
