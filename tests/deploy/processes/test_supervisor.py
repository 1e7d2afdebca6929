"""Promises of the supervisor about processes that die, come and go, with stand-ins for processes."""

import selectors
import signal
from pathlib import Path

import pytest
from support.stand_ins import SupervisedHost, spec

from rcopterx.deploy.processes.supervisor import (
    MAX_PAUSE_S,
    QUICK_RESTARTS,
    STABLE_AFTER_S,
    START_RETRY_S,
    STOP_LIMIT_S,
    restart_pause_s,
)
from rcopterx.deploy.processes.table import EXIT_ELSEWHERE

NO_FILES = OSError(24, "Too many open files")
CANNOT = "cannot be started: [Errno 24] Too many open files; trying again"


def test_processes_are_started_in_the_order_of_the_list_with_snapshot_and_log(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, *(spec(name) for name in ("c", "a", "b")))
    host.start()
    assert host.supervisor.running() == ["c", "a", "b"]
    assert [process.log for process in host.forks.started] == [host.logs / f"{name}.log" for name in "cab"]
    snapshot = (tmp_path / "lab.toml").resolve()
    assert {tuple(each.command) for each in host.forks.started} == {tuple(spec("a").command(snapshot))}
    assert host["a"].log.exists()
    assert (host.supervisor.pid("a"), host.supervisor.children["a"].started_s) == (
        host["a"].pid,
        host.clock(),
    )


def test_a_process_that_dies_is_back_at_once_and_that_is_reported(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spec("two"))
    host.start()
    before, other = host["one"], host["two"]
    before.end(-signal.SIGKILL)
    assert host.turn() == [
        f"one: killed by SIGKILL; log: {host.logs / 'one.log'}",
        "one: started again (restart 1)",
    ]
    assert host["one"] is not before
    assert host["two"] is other
    host["one"].end(-signal.SIGKILL)
    assert host.turn()[1] == "one: started again (restart 2)"
    assert [host.supervisor.children[name].restarts for name in ("one", "two")] == [2, 0]
    assert host.turn() == []


def test_deaths_at_the_same_time_are_all_reported(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spec("two"))
    host.start()
    host["one"].end(1)
    host["two"].end(1)
    assert sorted(line.split(";")[0] for line in host.turn()) == [
        "one: ended with exit code 1",
        "one: started again (restart 1)",
        "two: ended with exit code 1",
        "two: started again (restart 1)",
    ]


@pytest.mark.parametrize(
    ("code", "cause"),
    [
        (3, "ended with exit code 3"),
        (0, "ended with exit code 0"),
        (-1, "killed by SIGHUP"),
        (-signal.SIGRTMIN - 3, f"killed by signal {signal.SIGRTMIN + 3}"),
    ],
)
def test_the_exit_code_or_the_signal_that_ended_a_process_is_reported(
    tmp_path: Path, code: int, cause: str
) -> None:
    host = SupervisedHost(tmp_path, spec("one"))
    host.start()
    host["one"].end(code)
    assert host.turn()[0] == f"one: {cause}; log: {host.logs / 'one.log'}"


def test_a_process_that_cannot_start_is_retried_with_growing_pauses(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"))
    host.start()
    child = host.supervisor.children["one"]
    # The first deaths are followed by restarts at once, for a crash in flight.
    for deaths in range(1, QUICK_RESTARTS):
        host["one"].end(3)
        host.turn()
        assert (child.quick_deaths, child.restarts) == (deaths, deaths)
    for deaths in range(QUICK_RESTARTS, QUICK_RESTARTS + 4):
        host["one"].end(3)
        assert len(host.turn()) == 1
        pause_s = restart_pause_s(deaths)
        assert child.restart_at_s == pytest.approx(host.clock() + pause_s)
        assert host.turn(0.99 * pause_s) == []
        assert host.supervisor.running() == []
        assert host.turn(0.02 * pause_s) == [f"one: started again (restart {deaths})"]


def test_pauses_between_restarts_double_up_to_the_longest() -> None:
    pauses_s = [restart_pause_s(QUICK_RESTARTS + further) for further in range(6)]
    assert pauses_s == pytest.approx([0.2, 0.4, 0.8, 1.6, 3.2, MAX_PAUSE_S])


@pytest.mark.parametrize(("lived_s", "pauses"), [(STABLE_AFTER_S, False), (STABLE_AFTER_S - 0.1, True)])
def test_a_process_that_lived_long_enough_is_restarted_at_once_again(
    tmp_path: Path, lived_s: float, pauses: bool
) -> None:
    host = SupervisedHost(tmp_path, spec("one"))
    host.start()
    child = host.supervisor.children["one"]
    child.quick_deaths = 10
    host["one"].end(1)
    host.turn(lived_s)
    assert child.quick_deaths == (11 if pauses else 0)
    assert host.supervisor.running() == ([] if pauses else ["one"])


def test_a_turn_waits_for_a_death_until_the_next_restart_is_due(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float | None] = []

    class Noting(selectors.DefaultSelector):
        def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
            waits.append(timeout)
            return super().select(0.0)

    monkeypatch.setattr("selectors.DefaultSelector", Noting)
    monkeypatch.setattr("time.sleep", waits.append)
    host = SupervisedHost(tmp_path, spec("one"), spec("two"))
    host.start()
    host.supervisor.watch(0.5)
    host.supervisor.children["one"].quick_deaths = QUICK_RESTARTS - 1
    host["one"].end(1)
    host.turn()
    host.supervisor.watch(0.5)
    host.supervisor.watch(0.1)
    host.turn(0.15)
    host["two"].end(EXIT_ELSEWHERE)
    host.turn()
    host.supervisor.watch(0.5)
    # A restart that is overdue waits no more.
    host.clock.advance(1.0)
    host.supervisor.watch(0.5)
    pause_s = restart_pause_s(QUICK_RESTARTS)
    assert waits == pytest.approx([0.5, 0.0, pause_s, 0.1, 0.0, 0.0, pause_s - 0.15, 0.0])
    assert host.supervisor.running() == ["one"]
    assert host.supervisor.turns == len(waits)


def test_processes_that_become_wanted_together_are_all_reported(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spec("two"))
    children = host.supervisor.children.values()
    for child in children:
        child.wanted = False
    host.start()
    assert host.supervisor.running() == []
    for child in children:
        child.wanted = True
    assert host.turn() == ["one: started", "two: started"]


def test_processes_are_stopped_group_by_group(tmp_path: Path) -> None:
    roles = {
        "router": "router",
        "tracker": "tracker",
        "agent_a": "agent",
        "gateway": "transmitters",
        "agent_b": "agent",
    }
    host = SupervisedHost(tmp_path, *(spec(name, role) for name, role in roles.items()))
    host.start()
    processes = {name: host[name] for name in roles}
    gateway = processes["gateway"]
    gateway.deaf = True
    for child in host.supervisor.children.values():
        child.wanted = False

    def signalled() -> set[str]:
        """Which ones have got SIGTERM after one more turn."""
        host.turn(0.1)
        return {name for name, process in processes.items() if process.signals}

    assert signalled() == {"agent_a", "agent_b"}
    assert signalled() == signalled() == {"agent_a", "agent_b", "gateway"}
    gateway.end(0)
    assert signalled() == {"agent_a", "agent_b", "gateway"}
    assert signalled() == {"agent_a", "agent_b", "gateway", "tracker"}
    assert signalled() == set(roles)
    assert host.supervisor.running() == []


def test_processes_that_stay_or_do_not_run_keep_nothing_from_leaving(tmp_path: Path) -> None:
    host = SupervisedHost(
        tmp_path,
        spec("stays", "agent"),
        spec("away", "transmitters"),
        spec("leaves", "tracker"),
        without=["away"],
    )
    host.start()
    host.supervisor.children["leaves"].wanted = False
    assert host.turn() == ["leaves: ended"]
    assert host.supervisor.running() == ["stays"]
    assert host["stays"].signals == []


@pytest.mark.parametrize("landing_s", [0.0, 10.0])
def test_a_process_that_does_not_end_is_killed_once_and_after_its_landing_only(
    tmp_path: Path, landing_s: float
) -> None:
    host = SupervisedHost(tmp_path, spec("deaf", landing_s=landing_s))
    host.start()
    deaf = host["deaf"]
    deaf.deaf = deaf.immortal = True
    host.supervisor.children["deaf"].wanted = False
    host.turn()
    host.turn(STOP_LIMIT_S + landing_s)
    assert deaf.signals == ["TERM"]
    for _ in range(3):
        host.turn(STOP_LIMIT_S + landing_s + 0.1)
    # A real-time thread that fills the processor would keep it from ending.
    assert deaf.signals == ["TERM", "KILL", "normal class"]
    assert host.supervisor.running() == ["deaf"]
    deaf.end(-signal.SIGKILL)
    assert host.turn() == ["deaf: ended"]
    assert host.supervisor.running() == []


def test_a_process_that_comes_again_can_be_stopped_again(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"))
    host.start()
    child = host.supervisor.children["one"]
    for _ in range(2):
        first = host["one"]
        child.wanted = False
        assert host.turn() == ["one: ended"]
        assert first.signals == ["TERM"]
        child.wanted, child.quick_deaths = True, QUICK_RESTARTS
        assert host.turn() == ["one: started"]
        assert child.quick_deaths == 0


def test_stopping_ends_everything_and_restarts_nothing(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spec("two", "transmitters"), spares=1)
    host.start()
    host.turn(1.0)
    spare = host.forks.started[-1]
    host.supervisor.stop_all()
    assert host.supervisor.running() == []
    assert spare.signals == ["KILL"]
    assert host.spares.processes == {}
    assert host.forks.closed
    for _ in range(3):
        assert host.turn(10.0) == []
    assert len(host.forks.started) == 3


def test_an_agent_whose_vehicle_another_one_flies_is_not_started_again(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"))
    host.start()
    host["one"].end(EXIT_ELSEWHERE)
    assert host.turn() == ["one: ended, because another agent flies h1"]
    assert host.turn(10.0) == []
    assert host.supervisor.running() == []
    child = host.supervisor.children["one"]
    assert (child.wanted, child.restarts) == (False, 0)


def test_the_next_start_that_succeeds_and_no_later_one_takes_over_a_vehicle(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), without=["one"])
    child = host.supervisor.children["one"]
    child.wanted = child.take_over = True
    host.forks.problem = NO_FILES
    assert host.turn()[-1] == f"one: {CANNOT}"
    host.forks.problem = None
    host.turn(START_RETRY_S)
    assert host["one"].command[-1] == "--take-over"
    host["one"].end(1)
    host.turn()
    assert "--take-over" not in host["one"].command


def test_processes_come_and_go_while_the_others_run_on(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spec("two"), without=["two"])
    host.start()
    assert host.supervisor.running() == ["one"]
    assert host.supervisor.pid("two") is None
    first = host["one"]
    host.supervisor.children["two"].wanted = True
    assert host.turn() == ["two: started"]
    assert host.supervisor.running() == ["one", "two"]
    host.supervisor.children["two"].wanted = False
    assert host.turn() == ["two: ended"]
    assert host.turn() == []
    assert host["one"] is first
    assert host.supervisor.children["two"].restarts == 0


def test_a_process_that_left_while_it_waited_for_its_restart_stays_away(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("crashing"))
    host.start()
    crashing = host.supervisor.children["crashing"]
    crashing.quick_deaths = QUICK_RESTARTS
    host["crashing"].end(3)
    host.turn()
    assert crashing.restart_at_s > host.clock()
    crashing.wanted = False
    assert host.turn() == []
    assert host.turn(MAX_PAUSE_S + 1.0) == []
    assert host.supervisor.running() == []


def test_the_end_of_the_transmitter_gateways_alone_lands_all_vehicles(tmp_path: Path) -> None:
    host = SupervisedHost(
        tmp_path, spec("radio", "transmitters"), spec("spare radio", "transmitters"), spec("agent-h1"),
        without=["spare radio"],
    )  # fmt: skip
    host.start()
    host.supervisor.land()
    assert host["radio"].signals == ["TERM"]
    assert host["agent-h1"].signals == []
