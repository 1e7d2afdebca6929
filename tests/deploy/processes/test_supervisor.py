"""Promises of the supervisor, with harmless processes that do nothing but live and die."""

import os
import shutil
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.supervised import (
    DIES,
    LIMITS,
    Supervise,
    fake,
    kill,
    watch_into,
    watch_until,
)
from support.waiting import DEADLINE_S, FakeClock, wait_for

import rcopterx.deploy.processes.supervisor
from rcopterx.deploy.processes.child import MAX_PAUSE_S, QUICK_RESTARTS, restart_pause_s
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.deploy.processes.supervisor import STABLE_AFTER_S, STOP_LIMIT_S, Supervisor
from rcopterx.deploy.processes.table import EXIT_ELSEWHERE, ProcessSpec
from rcopterx.deploy.spares.spares import Spares


def test_processes_are_started_in_the_order_of_the_list(supervise: Supervise, tmp_path: Path) -> None:
    supervisor = supervise(*(fake(name) for name in ("c", "a", "b")))
    supervisor.start_all()
    assert supervisor.running() == ["c", "a", "b"]
    started = [supervisor.children[name].started_s for name in ("c", "a", "b")]
    assert started == sorted(started)


def test_a_process_that_dies_is_back_at_once_and_that_is_reported(supervise: Supervise) -> None:
    supervisor = supervise(fake("one"), fake("two"))
    supervisor.start_all()
    other, before = supervisor.pid("two"), kill(supervisor, "one")
    lines = watch_until(supervisor, lambda: supervisor.children["one"].restarts == 1, "not restarted")
    assert supervisor.running() == ["one", "two"]
    assert supervisor.pid("one") != before
    assert supervisor.pid("two") == other
    assert lines[0].startswith("one: killed by SIGKILL; log: ")
    assert lines[0].endswith("one.log")
    assert lines[1] == "one: started again (restart 1)"


def test_the_exit_code_of_a_process_is_reported(supervise: Supervise) -> None:
    supervisor = supervise(fake("one", DIES))
    supervisor.start_all()
    lines = watch_until(supervisor, lambda: supervisor.children["one"].restarts, "not restarted")
    assert lines[0].startswith("one: ended with exit code 3; log: ")


def test_signals_without_a_name_do_not_stop_the_supervisor(supervise: Supervise) -> None:
    supervisor = supervise(fake("one"))
    supervisor.start_all()
    pid = supervisor.pid("one")
    assert pid is not None
    os.kill(pid, signal.SIGRTMIN + 3)
    lines = watch_until(supervisor, lambda: supervisor.children["one"].restarts == 1, "not restarted")
    assert lines[0].startswith(f"one: killed by signal {int(signal.SIGRTMIN) + 3}; ")


def test_a_process_that_cannot_start_is_retried_with_growing_pauses(supervise: Supervise) -> None:
    clock = FakeClock()
    supervisor = supervise(fake("one", DIES), clock=clock)
    supervisor.start_all()
    child = supervisor.children["one"]
    # The first deaths are followed by restarts at once, for a crash in flight.
    watch_until(supervisor, lambda: child.quick_deaths == QUICK_RESTARTS, "no quick restarts")
    assert child.restarts == QUICK_RESTARTS - 1
    for deaths in range(QUICK_RESTARTS, QUICK_RESTARTS + 4):
        pause_s = restart_pause_s(deaths)
        assert child.restart_at_s == pytest.approx(clock() + pause_s)
        clock.advance(0.99 * pause_s)
        assert supervisor.watch(0.0) == []
        assert supervisor.running() == []
        clock.advance(0.02 * pause_s)
        watch_until(supervisor, lambda deaths=deaths: child.quick_deaths == deaths + 1, "not retried")


def test_a_process_that_lived_long_enough_is_restarted_at_once_again(supervise: Supervise) -> None:
    clock = FakeClock()
    supervisor = supervise(fake("one"), clock=clock)
    supervisor.start_all()
    child = supervisor.children["one"]
    child.quick_deaths = 10
    clock.advance(STABLE_AFTER_S + 0.1)
    kill(supervisor, "one")
    watch_until(supervisor, lambda: child.restarts == 1, "not restarted at once")
    assert child.quick_deaths == 0


@given(st.integers(0, 60))
def test_pauses_grow_up_to_a_limit(deaths: int) -> None:
    pause_s = restart_pause_s(deaths)
    assert 0 <= pause_s <= restart_pause_s(deaths + 1) <= MAX_PAUSE_S
    assert (pause_s == 0) == (deaths < QUICK_RESTARTS)


def test_processes_are_stopped_group_by_group(
    supervise: Supervise, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = tmp_path / "journal"

    def writes(name: str) -> str:
        return (
            f'trap "echo stop {name} >> {journal}; exit 0" TERM; echo start >> {journal}; '
            "while :; do sleep 0.02; done"
        )

    orders = {"router": 4, "tracker": 2, "agent_a": 0, "gateway": 1, "agent_b": 0}
    supervisor = supervise(*(fake(name, writes(name), order) for name, order in orders.items()))
    supervisor.start_all()
    wait_for(lambda: journal.exists() and journal.read_text().count("start") == 5, "not all are ready")
    monkeypatch.setattr(rcopterx.deploy.processes.supervisor, "STOP_LIMIT_S", DEADLINE_S)
    supervisor.stop_all()
    assert supervisor.running() == []
    stops = [line.removeprefix("stop ") for line in journal.read_text().splitlines() if "stop" in line]
    assert set(stops[:2]) == {"agent_a", "agent_b"}
    assert stops[2:] == ["gateway", "tracker", "router"]


def test_a_process_that_does_not_end_is_killed_and_that_is_counted(
    supervise: Supervise, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready = tmp_path / "ready"
    stubborn = f'trap "" TERM; touch {ready}; exec sleep 600'

    def clock() -> float:
        """Time goes on once the polite one has ended, however long that takes."""
        return 0.0 if supervisor.children["polite"].process else 2.0 * DEADLINE_S

    supervisor = supervise(fake("polite"), fake("stubborn", stubborn), clock=clock)
    supervisor.start_all()
    wait_for(ready.exists, "not ready")
    monkeypatch.setattr(rcopterx.deploy.processes.supervisor, "STOP_LIMIT_S", DEADLINE_S)
    supervisor.stop_all()
    assert supervisor.running() == []


def test_a_stopped_supervisor_restarts_nothing(supervise: Supervise) -> None:
    clock = FakeClock()
    supervisor = supervise(fake("one"), clock=clock)
    supervisor.start_all()
    supervisor.stop_all()
    for _ in range(3):
        clock.advance(10.0)
        assert supervisor.watch(0.01) == []
    assert supervisor.running() == []


def test_output_is_appended_to_a_log_and_the_environment_is_set(supervise: Supervise, tmp_path: Path) -> None:
    supervisor = supervise(
        fake("one", 'echo "$OMP_NUM_THREADS $RCOPTERX_PARENT $0"; echo problem >&2; exit 1')
    )
    supervisor.start_all()
    watch_until(supervisor, lambda: supervisor.children["one"].quick_deaths == 2, "did not run twice")
    line = f"1 {os.getpid()} {(tmp_path / 'lab.toml').resolve()}\nproblem\n"
    assert (tmp_path / "one.log").read_text().startswith(2 * line)


def test_a_command_line_names_the_role_of_its_process() -> None:
    command = ProcessSpec("agent-h1", "agent", "h1", 0).command(Path("/x/lab.toml"))
    assert command == [sys.executable, "-m", "rcopterx.deploy.roles", "agent", "h1", "/x/lab.toml"]
    moved = ProcessSpec("agent-h1", "agent", "h1", 0, "second").command(Path("/x/lab.toml"), take_over=True)
    assert moved == [*command, "second", "--take-over"]


def test_an_agent_whose_vehicle_another_one_flies_is_not_started_again(supervise: Supervise) -> None:
    supervisor = supervise(fake("one", f"exit {EXIT_ELSEWHERE}"))
    supervisor.start_all()
    lines = watch_until(supervisor, lambda: not supervisor.children["one"].wanted, "it is started again")
    assert any(line.startswith("one: ended, because another agent flies") for line in lines)
    assert supervisor.running() == []
    assert supervisor.children["one"].restarts == 0


def test_processes_come_and_go_while_the_others_run_on(supervise: Supervise) -> None:
    supervisor = supervise(fake("one"), fake("two"), without=["two"])
    supervisor.start_all()
    assert supervisor.running() == ["one"]
    pid = supervisor.pid("one")
    supervisor.children["two"].wanted = True
    lines = watch_until(supervisor, lambda: supervisor.running() == ["one", "two"], "two is not started")
    assert lines == ["two: started"]
    supervisor.children["two"].wanted = False
    lines = watch_until(supervisor, lambda: supervisor.running() == ["one"], "two does not end")
    assert lines == ["two: ended"]
    assert supervisor.watch(0.0) == []
    assert supervisor.pid("one") == pid
    assert supervisor.children["two"].restarts == 0


def test_a_process_that_does_not_want_to_leave_is_ended_once(
    supervise: Supervise, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, ready = FakeClock(), tmp_path / "ready"
    supervisor = supervise(fake("deaf", f"trap '' TERM; touch {ready}; exec sleep 600"), clock=clock)
    supervisor.start_all()
    wait_for(ready.exists, "not ready")
    supervisor.children["deaf"].wanted = False
    supervisor.watch(0.05)
    assert supervisor.running() == ["deaf"]
    clock.advance(STOP_LIMIT_S + 0.1)
    process = supervisor.children["deaf"].process
    assert process is not None
    with monkeypatch.context() as patch:
        kills: list[int] = []
        patch.setattr(process, "kill", lambda: kills.append(process.pid))
        for _ in range(3):
            supervisor.watch(0.0)
        assert kills == [process.pid]
    process.kill()
    watch_until(supervisor, lambda: supervisor.running() == [], "it is not ended")


def test_a_process_that_left_while_it_waited_for_its_restart_stays_away(supervise: Supervise) -> None:
    clock = FakeClock()
    supervisor = supervise(fake("crashing", DIES), clock=clock)
    supervisor.start_all()
    crashing = supervisor.children["crashing"]
    watch_until(supervisor, lambda: crashing.restart_at_s > clock(), "it is restarted at full speed")
    crashing.wanted = False
    supervisor.watch(0.0)
    clock.advance(MAX_PAUSE_S + 1)
    assert supervisor.watch(0.0) == []
    assert supervisor.running() == []


def test_a_process_without_a_place_for_its_log_is_restarted_all_the_same(
    supervise: Supervise, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    supervisor = supervise(fake("one"))
    supervisor.start_all()

    def refused(self: Path, *_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "mkdir", refused)
    kill(supervisor, "one")
    lines = watch_until(supervisor, lambda: supervisor.children["one"].restarts == 1, "not restarted")
    assert any(line.startswith("one: writes no log: ") for line in lines)
    assert supervisor.running() == ["one"]


def test_a_log_directory_that_was_removed_is_made_again(tmp_path: Path) -> None:
    logs = tmp_path / "log"
    logs.mkdir()
    supervisor = Supervisor([fake("one")], tmp_path / "fleet.json", logs, ForkServer())
    try:
        supervisor.start_all()
        shutil.rmtree(logs)
        kill(supervisor, "one")
        watch_until(supervisor, lambda: supervisor.children["one"].restarts == 1, "not restarted")
        assert (logs / "one.log").exists()
    finally:
        supervisor.stop_all()


@pytest.mark.parametrize("function", ["forking.HeartbeatPage", "forking.os.pidfd_open"])
def test_a_process_that_cannot_be_started_for_want_of_resources_is_started_later(
    supervise: Supervise, monkeypatch: pytest.MonkeyPatch, function: str
) -> None:
    supervisor = supervise(fake("one"), fake("two"))
    supervisor.start_all()

    def exhausted(*_: object, **__: object) -> None:
        raise OSError(24, "Too many open files")

    with monkeypatch.context() as patch:
        patch.setattr(f"rcopterx.deploy.processes.{function}", exhausted)
        kill(supervisor, "one")
        lines: list[str] = []

        def tried_twice() -> bool:
            lines.extend(supervisor.watch(0.01))
            failure = "one: cannot be started: [Errno 24] Too many open files; trying again"
            return lines.count(failure) >= 2

        wait_for(tried_twice, "not tried again")
        assert supervisor.running() == ["two"]
    watch_until(supervisor, lambda: supervisor.children["one"].restarts == 1, "not restarted")
    assert supervisor.running() == ["one", "two"]


def test_a_spare_that_cannot_be_started_ends_nothing(
    supervise: Supervise, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries = []

    def exhausted(self: Spares) -> None:
        tries.append(self)
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(Spares, "prepare", exhausted)
    supervisor = supervise(fake("one"))
    supervisor.start_all()
    watch_until(supervisor, lambda: tries, "no spare is tried")
    assert supervisor.running() == ["one"]


@pytest.mark.parametrize("failing", ["preparation of spares", "watchdog", "death of another process"])
def test_an_error_in_the_supervisor_is_reported_once_and_everything_else_goes_on(
    supervise: Supervise, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    def fails(*_: object) -> None:
        raise ValueError("an unforeseen value")

    supervisor = supervise(fake("one"), fake("two"), watchdog=LIMITS)
    supervisor.start_all()
    if failing == "preparation of spares":
        monkeypatch.setattr(Spares, "prepare", fails)
    elif failing == "watchdog":
        monkeypatch.setattr(supervisor.liveness, "check", fails)
    else:
        monkeypatch.setattr(supervisor.children["two"].process, "wait", fails)
        kill(supervisor, "two")
    turns = supervisor.turns
    lines: list[str] = []
    watch_into(lines, supervisor, lambda: any("an unforeseen value" in line for line in lines), "no error")
    kill(supervisor, "one")
    watch_into(lines, supervisor, lambda: supervisor.children["one"].restarts == 1, "not restarted")
    assert sum("ValueError: an unforeseen value (test_supervisor.py" in line for line in lines) == 1
    assert supervisor.turns > turns
    monkeypatch.undo()
