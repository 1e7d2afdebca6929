"""Promises of the supervisor with harmless processes that do nothing but live and die."""

import os
from pathlib import Path

import pytest
from support.supervised import Supervise, fake, kill, watch_until
from support.waiting import DEADLINE_S, wait_for

import rcopterx.deploy.processes.supervisor


def test_a_process_that_dies_is_back_at_once_and_the_others_run_on(supervise: Supervise) -> None:
    supervisor = supervise(fake("one"), fake("two"))
    supervisor.start_all()
    other, before = supervisor.pid("two"), kill(supervisor, "one")
    lines = watch_until(supervisor, lambda: supervisor.children["one"].restarts == 1, "not restarted")
    assert supervisor.running() == ["one", "two"]
    assert supervisor.pid("one") != before
    assert supervisor.pid("two") == other
    assert lines[0].startswith("one: killed by SIGKILL; log: ")


def test_a_process_that_does_not_end_is_killed(
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


def test_output_is_appended_to_a_log_and_the_environment_is_set(supervise: Supervise, tmp_path: Path) -> None:
    supervisor = supervise(
        fake("one", 'echo "$OMP_NUM_THREADS $RCOPTERX_PARENT $0"; echo problem >&2; exit 1')
    )
    supervisor.start_all()
    watch_until(supervisor, lambda: supervisor.children["one"].quick_deaths == 2, "did not run twice")
    line = f"1 {os.getpid()} {(tmp_path / 'lab.toml').resolve()}\nproblem\n"
    assert (tmp_path / "one.log").read_text().startswith(2 * line)


@pytest.mark.parametrize("function", ["forking.HeartbeatPage", "forking.os.pidfd_open"])
def test_a_process_that_cannot_be_started_for_want_of_descriptors_is_started_later(
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
