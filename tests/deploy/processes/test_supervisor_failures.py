"""Promises of the supervisor about what cannot be started or logged, and about its own errors."""

import os
import shutil
from pathlib import Path

import pytest
from support.stand_ins import StandIn, SupervisedHost, spec

from rcopterx.deploy.processes.supervisor import PREPARE_S, START_RETRY_S, Supervisor
from rcopterx.fleet.schema import WatchdogConfig

NO_FILES = OSError(24, "Too many open files")
CANNOT = "cannot be started: [Errno 24] Too many open files; trying again"


def test_a_process_without_a_place_for_its_log_is_restarted_all_the_same(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"))
    host.start()
    shutil.rmtree(host.logs)
    host.logs.touch()
    host["one"].end(1)
    _, problem, started = host.turn()
    assert problem.startswith("one: writes no log: ")
    assert started == "one: started again (restart 1)"
    assert host["one"].log == Path(os.devnull)


def test_a_log_directory_that_was_removed_is_made_again(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path / "flights" / "today", spec("one"))
    host.start()
    shutil.rmtree(tmp_path / "flights")
    host["one"].end(1)
    host.turn()
    assert host["one"].log == host.logs / "one.log"
    assert host["one"].log.exists()


def test_a_process_that_cannot_be_started_for_want_of_resources_is_started_later(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spec("two"))
    host.start()
    one = host.supervisor.children["one"]
    host.forks.problem = NO_FILES
    host["one"].end(1)
    assert f"one: {CANNOT}" in host.turn()
    assert one.restart_at_s == pytest.approx(host.clock() + START_RETRY_S)
    assert f"one: {CANNOT}" not in host.turn(0.9 * START_RETRY_S)
    assert f"one: {CANNOT}" in host.turn(0.2 * START_RETRY_S)
    assert (host.supervisor.running(), one.restarts) == (["two"], 0)
    host.forks.problem = None
    assert host.turn(START_RETRY_S + 0.01) == ["one: started again (restart 1)"]
    assert host.supervisor.running() == ["one", "two"]


def test_processes_that_cannot_be_started_at_first_are_named_and_the_others_start(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spec("two"), without=["two"])
    host.forks.problem = ValueError("an unforeseen value")
    assert host.supervisor.start_all() == ["one: cannot be started: an unforeseen value; trying again"]
    host.supervisor.children["two"].wanted = True
    assert host.turn(PREPARE_S)[-1] == "two: cannot be started: an unforeseen value; trying again"
    host.forks.problem = None
    assert host.turn(10.0) == [f"{name}: started again (restart 1)" for name in ("one", "two")]


def fails(*_: object) -> None:
    raise ValueError("an unforeseen value")


@pytest.mark.parametrize(
    "failing",
    [
        "preparing spares",
        "starting and stopping",
        "the watchdog",
        "handling the death of two",
        "restarting",
    ],
)
def test_an_error_in_the_supervisor_is_reported_once_and_everything_else_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    limits = WatchdogConfig(flight_s=0.5, floor_s=0.5, start_s=60.0)
    host = SupervisedHost(tmp_path, spec("one"), spec("two"), watchdog=limits)
    host.start()
    if failing == "preparing spares":
        monkeypatch.setattr(host.spares, "prepare", fails)
        host.clock.advance(1.0)
    elif failing == "starting and stopping":
        monkeypatch.setattr(StandIn, "terminate", fails)
        host.supervisor.children["two"].wanted = False
    elif failing == "the watchdog":
        monkeypatch.setattr(host.supervisor.liveness, "check", fails)
    elif failing == "handling the death of two":
        monkeypatch.setattr(StandIn, "wait", fails)
        host["two"].end(1)
    else:
        monkeypatch.setattr(Supervisor, "start", fails)
        host["two"].end(1)
    found = [line for _ in range(3) for line in host.turn() if "an unforeseen value" in line]
    assert len(found) == 1
    assert found[0].startswith(f"launcher: {failing} failed: ValueError: an unforeseen value (")
    monkeypatch.undo()
    host["one"].end(1)
    assert "one: started again (restart 1)" in host.turn(1.0)
