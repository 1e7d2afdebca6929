"""Promises of the watchdog about transmitter gateways, which it kills last and seldom."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.records import replace
from support.watched import DEAF, LIMITS, OTHER, STEP_S, Host, seen

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.bus.processes import Duty
from rcopterx.deploy.watchdog.watchdog import (
    AGAIN_S,
    APART_S,
    Excuse,
)


def test_a_transmitter_gateway_that_hangs_alone_is_killed_in_time() -> None:
    found_after_s = Host(*[LoopPhase.FLYING] * 3, duty=Duty.RADIO).found_after_s(DEAF)
    assert found_after_s is not None
    assert found_after_s <= LIMITS.flight_s + 1.01 * STEP_S


def test_a_transmitter_gateway_is_killed_later_while_processes_wait_for_processors() -> None:
    host = Host(*[LoopPhase.FLYING] * 3, duty=Duty.RADIO)
    host.looks = {number: replace(look, pressed_s=STEP_S) for number, look in host.looks.items()}
    assert host.found_after_s(DEAF) == pytest.approx(2 * LIMITS.flight_s, abs=1.01 * STEP_S)


def test_a_transmitter_gateway_does_not_wait_for_a_process_that_starts() -> None:
    host = Host(*[LoopPhase.FLYING] * 5, duty=Duty.RADIO)
    host.looks[OTHER] = replace(host.looks[OTHER], phase=LoopPhase.STARTING)
    for _ in range(round(0.5 * LIMITS.start_s / STEP_S)):
        host.look(OTHER)
    assert host.found_after_s(DEAF, OTHER, limit_s=LIMITS.flight_s + 2 * STEP_S) is not None


def test_a_transmitter_gateway_is_killed_after_all_others_that_are_silent_and_half_a_second_later() -> None:
    host = Host(*[LoopPhase.FLYING] * 5, duty=Duty.RADIO)
    kills: dict[int, float] = {}
    while len(kills) < 2:
        kills |= {hung.process: host.now_s for hung in host.look(DEAF, OTHER)}
    assert list(kills) == [OTHER, DEAF]
    assert APART_S <= kills[DEAF] - kills[OTHER] <= APART_S + 1.01 * STEP_S


def test_a_transmitter_gateway_that_goes_on_before_its_turn_is_spared() -> None:
    host = Host(*[LoopPhase.FLYING] * 5, duty=Duty.RADIO)
    while not host.look(DEAF, OTHER):
        pass
    del host.looks[OTHER]
    for _ in range(10):
        assert host.look(DEAF) == []
    assert host.look() == []
    assert host.found_after_s(limit_s=10.0) is None
    assert host.watchdog.forgiven == {"load": 1}


def test_the_successor_of_a_transmitter_gateway_is_not_killed_within_seconds() -> None:
    host = Host(*[LoopPhase.FLYING] * 3, duty=Duty.RADIO)
    assert host.found_after_s(DEAF) is not None
    killed_s = host.now_s
    successor = host.looks.pop(DEAF)
    host.looks[7] = successor
    assert host.found_after_s(7) is not None
    assert AGAIN_S <= host.now_s - killed_s <= AGAIN_S + 1.01 * STEP_S


def test_the_gateway_of_other_vehicles_need_not_wait_that_long() -> None:
    host = Host(*[LoopPhase.FLYING] * 5, duty=Duty.RADIO)
    host.looks[OTHER] = replace(host.looks[OTHER], duty=Duty.RADIO)
    kills: dict[int, float] = {}
    while len(kills) < 2:
        kills |= {hung.process: host.now_s for hung in host.look(DEAF, OTHER)}
    assert abs(kills[OTHER] - kills[DEAF]) == pytest.approx(APART_S, abs=1.01 * STEP_S)


def test_a_transmitter_gateway_that_was_stopped_waits_for_nothing() -> None:
    host = Host(*[LoopPhase.FLYING] * 5, duty=Duty.RADIO)
    stopped = Excuse(stopped=True)
    found = [hung for _ in range(9) for hung in host.look(DEAF, OTHER, deaf=stopped)]
    assert {hung.process for hung in found} == {DEAF, OTHER}
    successor = host.looks.pop(DEAF)
    host.looks[7] = replace(successor, excuse=stopped)
    assert host.found_after_s(7, limit_s=LIMITS.flight_s + 2 * STEP_S) is not None


duties = st.sampled_from([Duty.RADIO, Duty.FLIGHT, Duty.STANDBY])
silences = st.lists(st.tuples(st.sets(st.integers(1, 5)), st.integers(1, 60)), max_size=12)
"""Which processes are silent, and for how many checks."""


@given(st.lists(duties, min_size=5, max_size=5), silences, st.floats(0.005, 0.3))
def test_a_running_transmitter_gateway_is_never_killed_soon_after_a_kill(
    duties: list[Duty], silences: list[tuple[set[int], int]], step_s: float
) -> None:
    """Killed processes are followed by successors that are as silent as they were."""
    host = Host()
    host.looks = {number: seen(number, LoopPhase.FLYING, duty) for number, duty in enumerate(duties, 1)}
    radios = {number for number, duty in enumerate(duties, 1) if duty is Duty.RADIO}
    kills: list[tuple[float, int]] = []
    for silent in (silent for silent, checks in silences for _ in range(checks)):
        for hung in host.look(*silent, after_s=step_s):
            for at_s, process in kills:
                if hung.process in radios:
                    assert host.now_s - at_s >= (AGAIN_S if process == hung.process else APART_S)
            kills.append((host.now_s, hung.process))
        living = {number: look for number, look in host.looks.items() if (host.now_s, number) not in kills}
        host.watchdog.check(host.now_s, living)
