"""Promises of the supervisor about its fork server, spares and watchdog, with stand-ins for processes."""

import re
from pathlib import Path

import pytest
from support.stand_ins import StandIn, SupervisedHost, spec

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.deploy.processes.supervisor import (
    PREPARE_S,
    SETTLED_S,
    SPARE_RETRY_S,
    SPARE_SILENCE_S,
    Supervisor,
)
from rcopterx.deploy.watchdog.watchdog import AGAIN_S
from rcopterx.fleet.schema import WatchdogConfig

LIMITS = WatchdogConfig(flight_s=0.16, floor_s=1.0, start_s=30.0)
RADIO = spec("radio", "transmitters")
"""A transmitter gateway, whose last spare is kept for it."""
AGENT = spec("agent-h1")


@pytest.fixture(autouse=True)
def _idle_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other processes of the computer do not delay the gateways of a test."""
    monkeypatch.setattr("rcopterx.deploy.watchdog.liveness.pressure_s", lambda: 0.0)


def with_spares(directory: Path, count: int = 1, **options: object) -> tuple[SupervisedHost, list[StandIn]]:
    """A host whose processes have run for a while, and its spares."""
    host = SupervisedHost(directory, RADIO, AGENT, spares=count, **options)
    host.start()
    host.turn(2.0 * SETTLED_S)
    return host, host.forks.started[2:]


def test_no_spare_delays_a_process_that_has_just_been_started(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, RADIO, AGENT, spares=2)
    host.start()
    host.turn(SETTLED_S)
    assert len(host.forks.started) == 2
    host.turn(0.01)
    assert [process.command for process in host.forks.started[2:]] == [["spare"]] * 2
    assert host.supervisor.spares.complete


def test_a_spare_takes_the_place_of_a_process_that_died(tmp_path: Path) -> None:
    host, (spare,) = with_spares(tmp_path)
    host["radio"].end(1)
    host.turn()
    assert host["radio"] is spare
    order = b'{"role": "transmitters", "unit": "radio", "log": "%b", "take_over": false}\n'
    assert host.spares.processes == {}
    assert spare.orders == [order % str(host.logs / "radio.log").encode()]


def test_a_spare_gets_the_order_to_take_over_a_vehicle(tmp_path: Path) -> None:
    host, spares = with_spares(tmp_path, count=2)
    host.supervisor.children["agent-h1"].take_over = True
    host["agent-h1"].end(1)
    host.turn()
    assert host["agent-h1"] is spares[0]
    assert b'"take_over": true' in spares[0].orders[0]


@pytest.mark.parametrize(
    ("silent_s", "used"), [(SPARE_SILENCE_S - 0.02, True), (SPARE_SILENCE_S + 0.02, False)]
)
def test_a_spare_that_makes_no_progress_takes_no_place(tmp_path: Path, silent_s: float, used: bool) -> None:
    host, (spare,) = with_spares(tmp_path, watchdog=LIMITS)
    host.turns(0.1)
    host.turns(silent_s, spare, step_s=0.01)
    host["radio"].end(1)
    host.turn()
    assert (host["radio"] is spare) == used


def test_the_fork_server_is_checked_now_and_then_and_at_once_after_a_death(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"))
    host.start()
    checks = []
    for after_s in (0.0, 0.6 * PREPARE_S, 0.6 * PREPARE_S, 0.6 * PREPARE_S):
        assert host.turn(after_s) == []
        checks.append(host.forks.checks)
    assert checks == [1, 1, 2, 2]
    host["one"].end(1)
    host.turn()
    host.turn()
    assert host.forks.checks == 3
    # As long as a spare is missing, in every turn.
    host = SupervisedHost(tmp_path, spec("one"), spares=1)
    host.start()
    for _ in range(3):
        host.turn()
    assert host.forks.checks == 3


def test_a_new_fork_server_and_one_that_cannot_be_started_are_reported(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"))
    host.start()
    host.forks.replaced = True
    assert host.turn() == ["fork server: had ended, started again"]
    host.forks.problem = OSError("no memory")
    assert host.turn(PREPARE_S) == ["fork server: cannot be started: no memory; trying again"]


def test_a_host_that_needs_no_process_needs_no_fork_server(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spares=1, without=["one"])
    host.start()
    assert host.turn(10.0) == []
    assert host.forks.checks == 0
    assert host.forks.started == []


def test_a_spare_that_cannot_be_started_ends_nothing_and_is_tried_again_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spares=1)
    host.start()
    tries = []

    def refused() -> None:
        tries.append(host.clock())
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(host.spares, "prepare", refused)
    began_s = host.clock()
    for _ in range(50):
        assert host.turn(0.05) == []
    assert host.supervisor.running() == ["one"]
    waits_s = [b - a for a, b in zip([began_s, *tries], tries, strict=False)]
    assert waits_s == pytest.approx([SETTLED_S + 0.05, SPARE_RETRY_S, SPARE_RETRY_S], abs=0.051)
    assert host.forks.checks == 50


@pytest.mark.parametrize(
    ("role", "phase", "limit_s"),
    [
        ("agent", LoopPhase.FLYING, LIMITS.flight_s),
        ("agent", LoopPhase.WORKING, LIMITS.floor_s),
        ("transmitters", LoopPhase.WORKING, LIMITS.floor_s),
        ("simulator", LoopPhase.FLYING, LIMITS.start_s),
        ("recorder", LoopPhase.FLYING, LIMITS.start_s),
    ],
)
def test_a_process_that_makes_no_progress_is_replaced_reported_and_counted(
    tmp_path: Path, role: str, phase: LoopPhase, limit_s: float
) -> None:
    host = SupervisedHost(tmp_path, spec("one", role), AGENT, watchdog=LIMITS)
    host.start()
    host["agent-h1"].page.phase = phase
    hung, other = host["one"], host["agent-h1"]
    assert host.turns(limit_s, hung) == []
    lines = host.turns(0.1, hung)
    assert lines[0].startswith("one: hung: no progress for ")
    assert lines[0].endswith(f"{limit_s:g} s are allowed; killed by SIGKILL; log: {host.logs / 'one.log'}")
    assert lines[1:] == ["one: started again (restart 1)"]
    assert (host["agent-h1"], hung.signals) == (other, ["KILL"])
    assert [host.supervisor.children[name].hung for name in ("one", "agent-h1")] == [1, 0]
    # The next death has another cause, and the one after it the same.
    host["one"].end(3)
    assert host.turn()[0].startswith("one: ended with exit code 3")
    # A transmitter gateway is not killed again at once.
    host.turns(AGAIN_S)
    host.turns(limit_s + 0.1, host["one"])
    assert host.supervisor.children["one"].hung == 2


def test_the_silence_of_a_process_that_hangs_is_reported(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, AGENT, spec("two"), watchdog=LIMITS)
    host.start()
    line, _ = host.turns(1.1, host["agent-h1"])
    assert re.match(r"agent-h1: hung: no progress for 1\.0[0-3] s, 1 s are allowed; ", line)


def test_a_process_that_is_killed_and_does_not_end_leaves_the_real_time_class(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, AGENT, spec("two"), watchdog=LIMITS)
    host.start()
    hung = host["agent-h1"]
    hung.immortal = True
    host.turns(1.1, hung)
    assert hung.signals[:2] == ["KILL", "normal class"]
    assert "KILL" not in hung.signals[1:]
    assert host["two"].signals == []


def test_a_process_that_leaves_is_not_killed_for_its_silence(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, AGENT, spec("two"), watchdog=LIMITS)
    host.start()
    leaving = host["agent-h1"]
    leaving.deaf = True
    host.supervisor.children["agent-h1"].wanted = False
    assert host.turns(5.0, leaving) == []
    assert leaving.signals == ["TERM"]


def test_transmitter_gateways_are_killed_after_all_others(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, RADIO, AGENT, spec("two"), spec("three"), spec("four"), watchdog=LIMITS)
    host.start()
    host["two"].page.phase = LoopPhase.FLYING
    hang = [host["radio"], host["agent-h1"]]
    assert [line.split(":")[0] for line in host.turns(0.5, *hang)] == ["agent-h1"] * 2
    assert [line.split(":")[0] for line in host.turns(0.5, *hang)] == ["radio"] * 2


def test_a_spare_that_hangs_is_replaced_and_counted(tmp_path: Path) -> None:
    host, (spare,) = with_spares(tmp_path, watchdog=LIMITS)
    (line,) = host.turns(1.1, spare)
    assert re.fullmatch(r"spare: no progress for 1\.0[0-3] s, replaced", line)
    assert spare.signals[0] == "KILL"
    host.turns(1.1, host.forks.started[-1])
    assert host.supervisor.spares_hung == 2
    assert [child.hung for child in host.supervisor.children.values()] == [0, 0]
    assert list(host.spares.processes) == [host.forks.started[-1].pid]
    assert host.forks.started[-1] is not spare


@pytest.mark.parametrize(
    ("roles", "limit_s"),
    [
        (("router", "tracker"), LIMITS.flight_s),
        (("router", "agent"), LIMITS.floor_s),
        (("router", "transmitters"), LIMITS.floor_s),
    ],
)
def test_where_no_process_knows_whether_vehicles_fly_they_always_may(
    tmp_path: Path, roles: tuple[str, ...], limit_s: float
) -> None:
    host = SupervisedHost(tmp_path, *(spec(role, role) for role in roles), watchdog=LIMITS)
    host.start()
    assert host.turns(limit_s, host["router"]) == []
    assert host.turns(0.1, host["router"]) != []


def test_silences_are_known_with_a_watchdog_only(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, AGENT, spec("two"), watchdog=LIMITS)
    assert host.supervisor.watchdog_on
    assert host.supervisor.longest_silence_s("two") == 0.0
    host.start()
    host.turns(0.5, host["two"])
    host.turns(0.1)
    assert host.supervisor.longest_silence_s("two") == pytest.approx(0.5, abs=0.03)
    assert host.supervisor.longest_silence_s("agent-h1") < 0.1
    assert host.supervisor.watchdog.forgiven == {}
    host.turn(0.2)
    assert host.supervisor.watchdog.forgiven == {"supervisor_late": 1}
    host = SupervisedHost(tmp_path, AGENT)
    host.start()
    assert host.turns(10.0, host["agent-h1"]) == []
    assert not host.supervisor.watchdog_on
    assert host.supervisor.longest_silence_s("agent-h1") == 0.0
    assert host.supervisor.watchdog.forgiven == {}


def test_vehicles_fly_if_any_process_says_so(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path, spec("one"), spec("two"))
    assert not host.supervisor.flying
    host.start()
    assert not host.supervisor.flying
    host["two"].page.phase = LoopPhase.FLYING
    assert host.supervisor.flying


def test_without_a_list_of_them_there_are_no_spares(tmp_path: Path) -> None:
    host = SupervisedHost(tmp_path)
    supervisor = Supervisor([spec("one")], tmp_path / "lab.toml", tmp_path, host.forks)
    supervisor.start_all()
    supervisor.watch(0.0)
    assert len(host.forks.started) == 1
    assert supervisor.spares.complete
