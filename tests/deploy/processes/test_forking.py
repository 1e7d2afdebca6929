"""Promises of the fork server: processes that behave as if they had been started by their command line."""

import json
import os
import select
import selectors
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest
from support.fleets import PAIR
from support.waiting import DEADLINE_S, FakeClock, wait_for

import rcopterx.deploy.processes.forking
from rcopterx.bus.heartbeat import HeartbeatPage
from rcopterx.bus.realtime import request_realtime
from rcopterx.deploy.processes.forking import RETRY_S, START_LIMIT_S, ForkedProcess, ForkServer
from rcopterx.deploy.watchdog.processor_time import threads_of
from rcopterx.fleet.reading import parse_fleet, write_snapshot

REPORT = """
import json, os, sys
print(json.dumps({
    "name": __name__, "arguments": sys.argv, "parent": os.getppid(), "session": os.getsid(0),
    "pid": os.getpid(), "parent_variable": os.environ["RCOPTERX_PARENT"], "secret": os.environ.get("SECRET"),
    "preloaded": "tabnanny" in set(sys.modules), "input": sys.stdin.read(),
}))
print("problem", file=sys.stderr)
sys.exit(7)
"""
MODULE = "rcopterx_forked_module"


def request_realtime_in_child() -> bool:
    """Whether processes of this user may have a real-time priority."""
    program = "from rcopterx.bus.realtime import request_realtime; exit(not request_realtime(1))"
    return subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


@pytest.fixture
def forks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ForkServer]:
    (tmp_path / f"{MODULE}.py").write_text(REPORT)
    path = os.environ.get("PYTHONPATH")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *([path] if path else [])]))
    forks = ForkServer(["tabnanny"])
    yield forks
    forks.close()


def module(*words: str) -> list[str]:
    return [sys.executable, "-m", MODULE, *words]


def sleeping(forks: ForkServer, tmp_path: Path) -> ForkedProcess:
    return forks.start(["sleep", "600"], tmp_path / "log")


def end(started: ForkedProcess) -> int:
    started.kill()
    return started.wait(DEADLINE_S)


def test_a_module_runs_as_a_child_of_the_supervisor_in_a_session_of_its_own(
    forks: ForkServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    forks.ensure_running()
    # The environment is that of the moment, not that in which the fork server was started.
    monkeypatch.setenv("SECRET", "set later")
    log = tmp_path / "log"
    log.write_text("before\n")
    started = forks.start(module("one", "two"), log)
    assert started.wait(DEADLINE_S) == 7
    before, report, problem = log.read_text().splitlines()
    assert (before, problem) == ("before", "problem")
    seen = json.loads(report)
    assert seen["arguments"][1:] == ["one", "two"]
    assert (seen["name"], seen["input"], seen["secret"]) == ("__main__", "", "set later")
    assert seen["parent"] == os.getpid() == int(seen["parent_variable"])
    assert seen["session"] == seen["pid"] == started.pid
    assert seen["preloaded"]


def test_standard_input_can_be_a_pipe(forks: ForkServer, tmp_path: Path) -> None:
    started = forks.start(module(), tmp_path / "log", piped=True)
    assert started.stdin is not None
    started.stdin.write(b"an order\n")
    started.stdin.close()
    assert started.wait(DEADLINE_S) == 7
    assert json.loads((tmp_path / "log").read_text().splitlines()[0])["input"] == "an order\n"


def test_other_programs_are_executed_and_inherit_the_heartbeat_page(
    forks: ForkServer, tmp_path: Path
) -> None:
    shell = 'printf "\\001\\000\\000\\000\\000\\000\\000\\000" >&$RCOPTERX_HEARTBEAT; exec sleep 600'
    started = forks.start(["/bin/bash", "-c", shell], tmp_path / "log")
    try:
        wait_for(lambda: started.page.beats == 1, "the page is not the supervisor's")
    finally:
        assert end(started) == -signal.SIGKILL


@pytest.mark.skipif(not request_realtime_in_child(), reason="no permission for a real-time priority")
def test_what_a_fork_server_at_a_real_time_priority_starts_is_an_ordinary_process(
    tmp_path: Path,
) -> None:
    forks, log = ForkServer(priority=1), tmp_path / "log"
    program = "import os; print(os.sched_getscheduler(0) == os.SCHED_OTHER)"
    started = forks.start([sys.executable, "-c", program], log)
    assert forks.pid is not None
    assert os.sched_getscheduler(forks.pid) == os.SCHED_FIFO
    assert started.wait(DEADLINE_S) == 0
    forks.close()
    assert log.read_text() == "True\n"


def test_a_program_that_does_not_exist_ends_with_an_error_in_the_log(
    forks: ForkServer, tmp_path: Path
) -> None:
    assert forks.start(["/no/such/program"], tmp_path / "log").wait(DEADLINE_S) == 1
    assert "FileNotFoundError" in (tmp_path / "log").read_text()


def test_the_end_of_a_process_is_seen_once(forks: ForkServer, tmp_path: Path) -> None:
    process = sleeping(forks, tmp_path)
    assert process.poll() is None
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.01)
    process.terminate()
    assert process.wait(DEADLINE_S) == process.poll() == process.returncode == -signal.SIGTERM
    # There is no process left to signal.
    process.kill()


def short_process() -> ForkedProcess:
    page = HeartbeatPage()
    page.handed_over()
    return ForkedProcess(os.posix_spawn("/bin/sh", ["sh", "-c", "exit 3"], {}), page)


def test_threads_that_poll_one_process_all_see_its_exit_code() -> None:
    threads = 3
    for _ in range(40):
        process = short_process()
        ready = threading.Barrier(threads)

        def exit_code(process: ForkedProcess = process, ready: threading.Barrier = ready) -> int | None:
            ready.wait()
            while process.poll() is None:
                pass
            return process.returncode

        with ThreadPoolExecutor(threads) as pool:
            seen = [pool.submit(exit_code) for _ in range(threads)]
            assert [future.result() for future in seen] == [3] * threads


def test_the_descriptor_of_a_process_shows_its_end_also_after_another_thread_has_seen_it() -> None:
    process = short_process()
    with selectors.DefaultSelector() as selector:
        selector.register(process.descriptor, selectors.EVENT_READ)
        with ThreadPoolExecutor(1) as pool:
            assert pool.submit(process.wait).result() == 3
        assert selector.select(DEADLINE_S)
    assert process.wait(0.0) == 3


THREADS = """
import threading, time
for _ in range(12):
    threading.Thread(target=time.sleep, args=(600,), daemon=True).start()
print(flush=True)
time.sleep(600)
"""


def test_a_real_time_thread_learns_at_once_that_a_process_of_many_threads_has_ended() -> None:
    """Also after it has read the times of these threads from `/proc`, which the kernel must then clear."""

    def longest_wait_s() -> float:
        assert request_realtime(28, children=False)
        longest_s = 0.0
        for _ in range(8):
            program = subprocess.Popen([sys.executable, "-S", "-c", THREADS], stdout=subprocess.PIPE)
            page = HeartbeatPage()
            page.handed_over()
            process = ForkedProcess(program.pid, page)
            assert program.stdout is not None
            program.stdout.readline()
            assert len(threads_of(process.pid)) == 13
            process.kill()
            select.select([process.descriptor], [], [])
            from_s = time.monotonic()
            program.returncode = process.wait()
            longest_s = max(longest_s, time.monotonic() - from_s)
            program.stdout.close()
        return longest_s

    if not request_realtime_in_child():
        pytest.skip("no right to real-time priorities")
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(longest_wait_s).result() < 0.04


def test_what_was_started_outlives_the_fork_server_and_another_one_starts_the_next(
    tmp_path: Path,
) -> None:
    clock = FakeClock()
    forks = ForkServer(clock=clock)
    first = sleeping(forks, tmp_path)
    try:
        server = forks.pid
        assert server is not None
        os.kill(server, signal.SIGKILL)
        os.waitid(os.P_PID, server, os.WEXITED | os.WNOWAIT)
        with pytest.raises(OSError, match="fork server has ended"):
            sleeping(forks, tmp_path)
        assert forks.ensure_running() is False, "it was started a moment ago"
        clock.advance(RETRY_S)
        assert forks.ensure_running() is True
        assert forks.ensure_running() is False
        second: list[ForkedProcess] = []

        def next_one() -> bool:
            with suppress(BlockingIOError):
                second.append(sleeping(forks, tmp_path))
            return bool(second)

        wait_for(next_one, "nothing is started by another fork server")
        assert end(second[0]) == -signal.SIGKILL
        assert first.poll() is None
    finally:
        end(first)
        forks.close()


def test_a_fork_server_that_hangs_is_ended_and_leaves_no_unknown_process(
    forks: ForkServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert end(sleeping(forks, tmp_path)) == -signal.SIGKILL
    monkeypatch.setattr(rcopterx.deploy.processes.forking, "ANSWER_LIMIT_S", 0.1)
    server = forks.pid
    assert server is not None
    os.kill(server, signal.SIGSTOP)
    journal = tmp_path / "journal"
    with pytest.raises(OSError, match="does not answer"):
        forks.start(["/bin/sh", "-c", f"touch {journal}"], tmp_path / "log")
    assert forks.pid is None
    with pytest.raises(ProcessLookupError):
        os.kill(server, 0)
    assert not journal.exists()


def test_a_fork_server_has_more_time_where_that_of_the_fleet_passes_slowly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rcopterx.deploy.processes.forking, "ANSWER_LIMIT_S", 0.1)
    forks = ForkServer(speed=0.002)
    try:
        end(sleeping(forks, tmp_path))
        server = forks.pid
        assert server is not None
        os.kill(server, signal.SIGSTOP)
        timer = threading.Timer(0.5, os.kill, (server, signal.SIGCONT))
        timer.start()
        assert end(sleeping(forks, tmp_path)) == -signal.SIGKILL
        assert forks.pid == server
        timer.join()
    finally:
        forks.close()


def test_a_fork_server_that_cannot_import_says_so(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    forks = ForkServer(["rcopterx.no_such_module"])
    with pytest.raises(OSError, match="has ended"):
        sleeping(forks, tmp_path)
    forks.close()
    assert "No module named 'rcopterx.no_such_module'" in capfd.readouterr().err


PREPARED = """
import sys
from pathlib import Path
from rcopterx.deploy.roles.agent import prepared_pilot
from rcopterx.fleet.reading import load_fleet
fleet = load_fleet(Path(sys.argv[1]))
print(*(name for name in fleet.vehicles if prepared_pilot(fleet, name)))
"""


@pytest.mark.timeout(300)
def test_what_it_has_prepared_is_there_in_what_it_forks_also_after_it_had_to_be_started_again(
    forks: ForkServer, tmp_path: Path
) -> None:
    (tmp_path / f"{MODULE}.py").write_text(PREPARED)
    snapshot, log = tmp_path / "fleet.json", tmp_path / "log"
    write_snapshot(parse_fleet(PAIR), snapshot)
    forks.prepare_pilots(snapshot, "main", ["h1", "h2"])
    assert forks.start(module(str(snapshot)), log).wait(DEADLINE_S) == 0
    assert log.read_text() == "h1 h2\n"
    assert forks.pid is not None
    os.kill(forks.pid, signal.SIGKILL)

    def starts() -> bool:
        with suppress(OSError):
            return forks.start(module(str(snapshot)), log).wait(DEADLINE_S) == 0
        return False

    wait_for(starts, "it is not started again", deadline_s=START_LIMIT_S)
    assert log.read_text() == "h1 h2\nh1 h2\n"


def test_what_cannot_be_prepared_is_an_error_and_it_forks_all_the_same(
    forks: ForkServer, tmp_path: Path
) -> None:
    snapshot = tmp_path / "fleet.json"
    snapshot.write_text("{}")
    with pytest.raises(OSError, match="not a snapshot of a fleet file"):
        forks.prepare_pilots(snapshot, "main", ["h1"])
    assert end(sleeping(forks, tmp_path)) == -signal.SIGKILL
