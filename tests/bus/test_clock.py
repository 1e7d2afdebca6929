"""Promises of the clock of a fleet: a multiple of the monotonic clock, and at speed 1 that clock itself."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.waiting import FakeClock

from rcopterx.bus.clock import Clock
from rcopterx.bus.rounding import TIME_BITS
from rcopterx.bus.session import BusAddress

TICK_S = 2.0**-TIME_BITS
speeds = st.floats(0.01, 10.0)
durations = st.floats(0.0, 1e4)


def test_in_real_time_it_is_the_monotonic_clock_in_whole_ticks_and_never_ahead() -> None:
    assert BusAddress((), "lab").clock == Clock()
    before_s = time.monotonic()
    now_s = Clock().now()
    assert before_s - TICK_S <= now_s <= time.monotonic()
    assert (now_s * 2.0**TIME_BITS).is_integer()


@given(speeds)
def test_its_time_is_a_multiple_of_the_monotonic_time_in_whole_ticks(speed: float) -> None:
    now = Clock(speed).now
    before_s = time.monotonic()
    now_s = now()
    after_s = time.monotonic()
    assert speed * before_s - 2 * TICK_S <= now_s <= speed * after_s + TICK_S
    assert (now_s * 2.0**TIME_BITS).is_integer()


@given(speeds)
def test_it_never_runs_backwards(speed: float) -> None:
    now = Clock(speed).now
    times_s = [now() for _ in range(50)]
    assert times_s == sorted(times_s)


@given(speeds, durations, durations)
def test_a_duration_of_the_fleet_has_passed_when_it_has_passed_in_real_time(
    speed: float, start_s: float, duration_s: float
) -> None:
    real, clock = FakeClock(start_s), Clock(speed)
    began_s = speed * real()
    real.advance(clock.real_s(duration_s))
    assert speed * real() - began_s == pytest.approx(duration_s, rel=1e-6, abs=1e-6)


@given(durations)
def test_in_real_time_durations_are_unchanged(duration_s: float) -> None:
    assert Clock().real_s(duration_s) == duration_s
