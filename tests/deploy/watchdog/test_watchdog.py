"""Promises of the watchdog: what hangs is found in time, and nothing else is ever called hung."""

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.records import replace
from support.watched import DEAF, LIMITS, OTHER, STEP_S, THIRD, Host, seen

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.bus.processes import Duty
from rcopterx.deploy.watchdog.watchdog import (
    CROWD_LIMITS,
    LATE_S,
    TIMELY_S,
    Excuse,
    Hung,
    Watchdog,
    blamed_s,
)
from rcopterx.fleet.schema import WatchdogConfig


@pytest.mark.parametrize(
    ("make_host", "limit_s"),
    [
        (partial(Host, LoopPhase.WORKING, LoopPhase.FLYING, LoopPhase.WORKING), 0.15),
        (partial(Host, LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING), 0.15),
        (partial(Host, LoopPhase.WORKING, LoopPhase.WORKING, LoopPhase.WORKING), 1.0),
        (partial(Host, LoopPhase.WORKING, LoopPhase.WORKING, LoopPhase.WORKING, blind=True), 0.15),
        (partial(Host, LoopPhase.STARTING, LoopPhase.FLYING, LoopPhase.WORKING), 30.0),
        (partial(Host, LoopPhase.ENDING, LoopPhase.FLYING, LoopPhase.WORKING), 30.0),
        (partial(Host, LoopPhase.WORKING, LoopPhase.FLYING, LoopPhase.WORKING, duty=Duty.STANDBY), 1.0),
        (partial(Host, LoopPhase.WORKING, LoopPhase.FLYING, LoopPhase.WORKING, duty=Duty.BACKGROUND), 30.0),
    ],
    ids=[
        "another-flies", "itself-flies", "none-flies", "none-knows", "starting", "ending", "spare",
        "background",
    ],
)  # fmt: skip
def test_silence_is_a_hang_as_soon_as_it_is_longer_than_the_limit_of_the_moment(
    make_host: Callable[[], Host], limit_s: float
) -> None:
    found_after_s = make_host().found_after_s(DEAF)
    assert found_after_s is not None
    assert limit_s < found_after_s <= limit_s + 1.01 * STEP_S


def test_what_hangs_is_named_once_with_its_silence_and_its_limit() -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    found = [hung for _ in range(50) for hung in host.look(DEAF)]
    assert found == [Hung(DEAF, pytest.approx(0.16), 0.15)]
    assert host.watchdog.silent_s(DEAF) > 0.9
    assert host.watchdog.silent_s(OTHER) == 0.0
    assert host.watchdog.silent_s(99) == host.watchdog.longest_s(99) == 0.0


def test_a_process_that_replaces_one_that_hung_begins_anew() -> None:
    host = Host(LoopPhase.WORKING, LoopPhase.FLYING, LoopPhase.WORKING)
    assert host.found_after_s(DEAF) is not None
    host.looks = {7: seen(7, LoopPhase.STARTING), OTHER: host.looks[OTHER]}
    assert host.found_after_s(7, limit_s=10.0) is None
    assert host.watchdog.silent_s(DEAF) == 0.0


def test_a_change_of_phase_is_progress() -> None:
    host = Host(LoopPhase.WORKING, LoopPhase.FLYING, LoopPhase.WORKING)
    for _ in range(7):
        assert host.look(DEAF) == []
    host.looks[DEAF] = replace(host.looks[DEAF], phase=LoopPhase.STARTING)
    assert host.look(DEAF) == []
    assert host.watchdog.silent_s(DEAF) == 0.0
    assert host.found_after_s(DEAF, limit_s=10.0) is None


def test_take_off_shortens_the_limit_of_a_process_that_is_silent_already() -> None:
    host = Host(LoopPhase.WORKING, LoopPhase.WORKING, LoopPhase.WORKING)
    assert host.found_after_s(DEAF, limit_s=0.3) is None
    host.looks[OTHER] = replace(host.looks[OTHER], phase=LoopPhase.FLYING)
    assert [hung.limit_s for hung in host.look(DEAF)] == [0.15]


@given(
    st.lists(st.tuples(st.integers(1, 5), st.sampled_from([0.004, 0.02, 0.05, 0.099])), max_size=60),
    st.sampled_from([LoopPhase.WORKING, LoopPhase.FLYING]),
)
def test_a_process_that_beats_within_the_limit_never_hangs(
    looks: list[tuple[int, float]], phase: LoopPhase
) -> None:
    """Each of three processes beats when its turn comes, at the latest 0.1 s after its last beat."""
    host = Host(phase, LoopPhase.FLYING, LoopPhase.WORKING)
    last_s = dict.fromkeys(host.looks, host.now_s)
    for who, after_s in looks:
        silent = {number for number in host.looks if number != who}
        silent -= {number for number in silent if host.now_s + 2 * after_s - last_s[number] > 0.1}
        assert host.look(*silent, after_s=after_s) == []
        last_s |= {number: host.now_s for number in host.looks if number not in silent}
    assert not host.watchdog.forgiven


@given(st.floats(LATE_S * 1.01, 1e6), st.integers(0, 5))
def test_the_delay_of_the_supervisor_is_no_silence_of_processes(late_s: float, looks_before: int) -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    for _ in range(looks_before):
        assert host.look(DEAF) == []
    assert host.look(DEAF, OTHER, THIRD, after_s=late_s) == []
    assert host.watchdog.forgiven == {"supervisor_late": 1}
    assert host.watchdog.silent_s(DEAF) == pytest.approx(looks_before * STEP_S + TIMELY_S)
    assert host.found_after_s(DEAF) is not None


@given(st.integers(1, 200), st.floats(TIMELY_S, 1.0))
def test_a_supervisor_that_gets_little_processor_time_itself_takes_nothing_for_hung_too_early(
    checks: int, late_s: float
) -> None:
    """Not even without `schedstat`: each check counts as one in time."""
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    found = [host.look(DEAF, after_s=late_s) for _ in range(checks)]
    assert not any(found[: int(LIMITS.flight_s / TIMELY_S) - 1])


def test_a_check_that_is_only_just_not_late_is_not_counted_as_late() -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    assert host.look(DEAF, after_s=LATE_S * 0.99) == []
    assert host.watchdog.silent_s(DEAF) == pytest.approx(TIMELY_S)
    assert not host.watchdog.forgiven


@given(st.lists(st.tuples(st.floats(1e-3, 0.5), st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=60))
def test_a_process_is_blamed_for_no_more_than_the_time_in_which_it_could_run(
    intervals: list[tuple[float, float, float]],
) -> None:
    """Each interval has a duration, and the shares for which the process waits and the supervisor is late."""
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    could_run_s = 0.0
    for elapsed_s, waits, _ in intervals:
        could_run_s += elapsed_s * (1 - waits)
        host.look(DEAF, after_s=elapsed_s, deaf=Excuse(waited_s=elapsed_s * waits))
    assert host.watchdog.silent_s(DEAF) <= could_run_s + 1e-9


@given(st.floats(0, 10), st.floats(0, 10), st.booleans())
def test_blame_is_between_nothing_and_the_time_that_passed(
    elapsed_s: float, waited_s: float, stopped: bool
) -> None:
    def blamed(*, pressed_s: float = 0.0, duty: Duty = Duty.RADIO, **excuse: Any) -> float:
        look = seen(DEAF, LoopPhase.FLYING, duty)
        return blamed_s(elapsed_s, replace(look, excuse=Excuse(**excuse), pressed_s=pressed_s))

    assert 0.0 <= blamed(waited_s=waited_s, stopped=stopped, pressed_s=waited_s) <= elapsed_s
    assert blamed(waited_s=waited_s, stopped=True, pressed_s=elapsed_s) == elapsed_s
    assert blamed(waited_s=waited_s, stopped=stopped, traced=True) == 0.0
    assert blamed(waited_s=elapsed_s) == 0.0
    assert blamed() == blamed(pressed_s=elapsed_s, duty=Duty.FLIGHT) == min(elapsed_s, TIMELY_S)


def test_a_stopped_process_is_found_at_once_by_a_supervisor_that_was_late() -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    found = host.look(DEAF, OTHER, THIRD, after_s=0.3, deaf=Excuse(stopped=True))
    assert found == [Hung(DEAF, pytest.approx(0.3), LIMITS.flight_s)]


def test_time_without_a_processor_does_not_count_and_is_counted_as_forgiven_when_the_process_goes_on() -> (
    None
):
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    for _ in range(100):
        assert host.look(DEAF, deaf=Excuse(waited_s=STEP_S)) == []
    assert host.watchdog.longest_s(DEAF) == pytest.approx(2.0)
    assert not host.watchdog.forgiven
    assert host.look() == []
    assert host.watchdog.forgiven == {"load": 1}
    assert host.look(DEAF) == []
    assert host.watchdog.longest_s(DEAF) == pytest.approx(2.0)


def test_the_time_that_a_start_takes_is_no_silence_of_a_working_process() -> None:
    host = Host(LoopPhase.STARTING, LoopPhase.WORKING, LoopPhase.WORKING)
    for _ in range(50):
        assert host.look(DEAF) == []
    assert host.watchdog.silent_s(DEAF) == pytest.approx(1.0)
    assert host.watchdog.longest_s(DEAF) == 0.0


@pytest.mark.parametrize(("share", "found_s"), [(0.5, 0.3), (0.75, 0.6)])
def test_a_process_that_spins_on_a_loaded_machine_is_found_later(share: float, found_s: float) -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    excuse = Excuse(waited_s=share * STEP_S)
    found_after_s = host.found_after_s(DEAF, deaf=excuse)
    assert found_after_s == pytest.approx(found_s, abs=0.05)


@given(st.floats(0, 1e3))
def test_no_more_than_the_time_since_the_last_look_is_excused(waited_s: float) -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    for _ in range(5):
        host.look(DEAF)
    before_s = host.watchdog.silent_s(DEAF)
    host.look(DEAF, deaf=Excuse(waited_s=waited_s))
    assert host.watchdog.silent_s(DEAF) == pytest.approx(before_s + max(0.0, STEP_S - waited_s))


def test_a_process_is_suspected_when_it_has_been_silent_for_a_while_until_it_is_killed() -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    suspects = []
    while not host.look(DEAF):
        suspects.append(host.watchdog.suspects)
    assert suspects == [set()] + [{DEAF}] * 6
    assert host.watchdog.suspects == set()


def test_a_process_in_a_debugger_never_hangs() -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    assert host.found_after_s(DEAF, deaf=Excuse(traced=True), limit_s=60.0) is None
    assert host.look() == []
    assert not host.watchdog.forgiven


def test_most_processes_silent_at_once_are_load_for_a_while() -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING, LoopPhase.WORKING)
    found_after_s = host.found_after_s(DEAF, OTHER)
    limit_s = CROWD_LIMITS * LIMITS.flight_s
    assert found_after_s is not None
    assert limit_s < found_after_s <= limit_s + 1.01 * STEP_S
    assert host.watchdog.forgiven == {}


@pytest.mark.parametrize(
    "phases",
    [(LoopPhase.FLYING,), (LoopPhase.FLYING,) * 5],
    ids=["one-of-one", "two-of-five"],
)
def test_few_processes_silent_at_once_hang(phases: tuple[LoopPhase, ...]) -> None:
    host = Host(*phases)
    found_after_s = host.found_after_s(DEAF, OTHER)
    assert found_after_s is not None
    assert found_after_s <= LIMITS.flight_s + 1.01 * STEP_S


def test_a_successor_that_is_stopped_while_it_starts_is_found_in_time() -> None:
    host = Host(*[LoopPhase.FLYING] * 5)
    host.looks[DEAF] = replace(host.looks[DEAF], phase=LoopPhase.STARTING)
    while DEAF not in host.watchdog.suspects:
        assert host.look(DEAF) == []
        assert host.watchdog.silent_s(DEAF) < 0.1
    found_after_s = host.found_after_s(DEAF, deaf=Excuse(stopped=True))
    assert found_after_s is not None
    assert found_after_s <= LIMITS.flight_s


def test_stopped_processes_are_no_crowd() -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    stopped = dict.fromkeys(("deaf", "other", "third"), Excuse(stopped=True))
    found = [hung for _ in range(9) for hung in host.look(DEAF, OTHER, THIRD, **stopped)]
    assert {hung.process for hung in found} == {DEAF, OTHER, THIRD}


def test_a_stopped_process_is_found_while_most_others_are_late_through_load() -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.WORKING, LoopPhase.WORKING)
    stopped = Excuse(stopped=True)
    found = [hung for _ in range(9) for hung in host.look(DEAF, OTHER, THIRD, deaf=stopped)]
    assert [hung.process for hung in found] == [DEAF]
    assert host.look(OTHER, THIRD) == []


def test_silence_as_long_as_the_limit_is_no_hang_yet() -> None:
    """Times are powers of two, so that sums are exact."""
    watchdog = Watchdog(WatchdogConfig(flight_s=0.125, floor_s=0.25, start_s=30.0))
    looks = {DEAF: seen(DEAF, LoopPhase.WORKING)}
    found = [watchdog.check(number / 64, looks) for number in range(18)]
    assert [len(hung) for hung in found] == [0] * 17 + [1]
    assert watchdog.check(1.0, {OTHER: seen(OTHER, LoopPhase.WORKING)}) == []
    assert watchdog.longest_s(OTHER) == 0.0
