"""An oscillation goes on; a manoeuvre, a gust and noise do not."""

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL

from rcopterx.agents.flight.oscillation import (
    FAINT_HALF_WAVES,
    FAINT_THRESHOLD,
    HALF_WAVES,
    HALF_WAVES_AGAIN,
    HALF_WAVES_AWAY,
    THRESHOLD,
    Loop,
    OscillationDetector,
)
from rcopterx.vehicles.state import Array

PERIOD_S = 0.02
AT_REFERENCE = np.zeros(4)
FAR_AWAY = np.array([1.0, 0.0, 0.0, 0.0])
PITCH, ROLL, THRUST, YAW = range(4)


def first_s(
    signal: Callable[[float], float],
    channel: int = PITCH,
    seconds: float = 6.0,
    error: Array = AT_REFERENCE,
    resting: bool = False,
) -> float | None:
    """When an oscillation of a stick is first seen; None for never."""
    return next((time_s for time_s, _ in seen(signal, channel, seconds, error, resting)), None)


def found_in(signal: Callable[[float], float], channel: int, seconds: float, error: Array) -> set[Loop]:
    """All loops that were found to oscillate."""
    return set().union(*(loops for _, loops in seen(signal, channel, seconds, error)))


def seen(
    signal: Callable[[float], float], channel: int, seconds: float, error: Array, resting: bool = False
) -> Iterator[tuple[float, frozenset[Loop]]]:
    detector = OscillationDetector(COAXIAL)
    for k in range(round(seconds / PERIOD_S)):
        stick = COAXIAL.hover_input.copy()
        stick[channel] += signal(k * PERIOD_S)
        reference = np.zeros(4) if resting else under_way(k)
        loops = detector.observe(stick, None, still_at(reference + error), reference, PERIOD_S)
        if loops:
            yield k * PERIOD_S, loops


def under_way(period: int) -> Array:
    """A reference that moves slowly."""
    return np.array([0.1 * period * PERIOD_S, 0.0, 0.0, 0.0])


def still_at(place: Array) -> Array:
    """Motion of a vehicle that does not move."""
    return np.append(place, np.zeros(4))


def wave(frequency_hz: float, amplitude: float) -> Callable[[float], float]:
    return lambda time_s: amplitude * math.sin(math.tau * frequency_hz * time_s)


@settings(deadline=None, max_examples=40)
@given(st.floats(0.8, 4.5), st.floats(0.6, 1.0))
def test_an_oscillation_from_1_to_5_hz_is_seen_after_six_half_waves(
    frequency_hz: float, amplitude: float
) -> None:
    seen_s = first_s(wave(frequency_hz, amplitude))
    assert seen_s is not None
    assert seen_s == pytest.approx(0.5 * (HALF_WAVES - 1) / frequency_hz, abs=0.3 / frequency_hz + PERIOD_S)


def test_the_yaw_stick_counts_by_its_own_range() -> None:
    assert first_s(wave(2.0, 0.3), YAW) is not None
    assert first_s(wave(2.0, 0.15), YAW) is None


@pytest.mark.parametrize(
    ("channel", "loop"),
    [(PITCH, Loop.HORIZONTAL), (ROLL, Loop.HORIZONTAL), (THRUST, Loop.HEIGHT), (YAW, Loop.YAW)],
)
def test_the_loop_that_oscillates_is_told(channel: int, loop: Loop) -> None:
    assert found_in(wave(2.0, 0.38), channel, 6.0, AT_REFERENCE) == (set() if channel < THRUST else {loop})
    assert found_in(wave(2.0, 0.9), channel, 6.0, AT_REFERENCE) == {loop}


@pytest.mark.parametrize("deviation", [0.1, 0.2, 0.3])
def test_noise_of_the_whole_band_is_no_oscillation(deviation: float) -> None:
    noise = deviation * np.random.default_rng(3).standard_normal(30_000)
    assert first_s(lambda time_s: float(noise[round(time_s / PERIOD_S)]), seconds=600.0) is None


def test_half_waves_of_all_lengths_are_no_oscillation() -> None:
    lengths_s = np.resize([0.12, 0.4, 0.7, 0.2], 200)
    turns_s = np.cumsum(lengths_s)
    assert first_s(lambda time_s: (-1.0) ** np.searchsorted(turns_s, time_s), seconds=60.0) is None


@settings(deadline=None, max_examples=40)
@given(st.floats(0.1, 10.0), st.floats(0.0, THRESHOLD))
def test_what_stays_below_half_of_the_range_is_no_oscillation(frequency_hz: float, amplitude: float) -> None:
    assert first_s(wave(frequency_hz, amplitude)) is None


@settings(deadline=None, max_examples=30)
@given(st.floats(0.05, 0.55), st.floats(0.6, 1.0))
def test_slow_flight_to_and_fro_is_no_oscillation(frequency_hz: float, amplitude: float) -> None:
    assert first_s(wave(frequency_hz, amplitude), seconds=30.0) is None


def test_noise_that_changes_its_sign_every_period_is_no_oscillation() -> None:
    assert first_s(lambda time_s: 1.0 if round(time_s / PERIOD_S) % 2 else -1.0) is None


def test_far_from_the_reference_more_half_waves_are_needed() -> None:
    near_s, far_s = (first_s(wave(2.0, 1.0), error=error) for error in (AT_REFERENCE, FAR_AWAY))
    assert near_s is not None
    assert far_s is not None
    assert far_s - near_s == pytest.approx((HALF_WAVES_AWAY - HALF_WAVES) / 4.0, abs=0.05)


def test_a_pause_begins_the_count_anew() -> None:
    def interrupted(time_s: float) -> float:
        return 0.0 if time_s % 2.0 > 1.0 else wave(2.0, 1.0)(time_s)

    assert first_s(interrupted, seconds=20.0) is None


def test_the_tilt_counts_as_the_sticks_do() -> None:
    detector = OscillationDetector(COAXIAL)
    largest = float(COAXIAL.b[:2].mean()) / COAXIAL.gravity_m_s2
    seen = [
        detector.observe(
            COAXIAL.hover_input,
            np.array([0.0, 0.8 * largest * math.sin(math.tau * 2.0 * k * PERIOD_S)]),
            still_at(under_way(k)),
            under_way(k),
            PERIOD_S,
        )
        for k in range(150)
    ]
    assert any(seen)


@settings(deadline=None, max_examples=30)
@given(st.floats(0.8, 4.0), st.floats(0.27, 0.44))
def test_a_small_oscillation_is_seen_where_the_reference_rests(frequency_hz: float, amplitude: float) -> None:
    signal, seconds = wave(frequency_hz, amplitude), 10.0
    seen_s = first_s(signal, seconds=seconds, resting=True)
    assert seen_s == pytest.approx(
        0.5 * (FAINT_HALF_WAVES - 1) / frequency_hz, abs=0.3 / frequency_hz + PERIOD_S
    )
    assert first_s(signal, seconds=seconds) is None


@settings(deadline=None, max_examples=20)
@given(st.floats(0.1, 10.0), st.floats(0.0, FAINT_THRESHOLD))
def test_what_is_smaller_is_no_oscillation(frequency_hz: float, amplitude: float) -> None:
    assert first_s(wave(frequency_hz, amplitude), seconds=20.0, resting=True) is None


def test_gusts_at_rest_are_no_oscillation() -> None:
    generator, stick = np.random.default_rng(4), 0.0
    gusts = [stick := 0.96 * stick + 0.06 * float(generator.standard_normal()) for _ in range(60_000)]
    assert np.std(gusts) > 0.2
    assert first_s(lambda time_s: gusts[round(time_s / PERIOD_S)], seconds=1200.0, resting=True) is None


@pytest.mark.parametrize(("frequency_hz", "share"), [(1.0, 0.9), (2.7, 0.6)])
def test_frequency_and_size_of_an_oscillation_are_told(frequency_hz: float, share: float) -> None:
    detector, reach = OscillationDetector(COAXIAL), COAXIAL.u_max[YAW]
    for k in range(300):
        stick = COAXIAL.hover_input.copy()
        stick[YAW] += reach * wave(frequency_hz, share)(k * PERIOD_S)
        detector.observe(stick, None, still_at(under_way(k)), under_way(k), PERIOD_S)
    swing = detector.swings[Loop.YAW]
    assert swing.signal == "yaw stick"
    assert swing.frequency_hz == pytest.approx(frequency_hz, rel=0.15)
    assert swing.size == pytest.approx(share, rel=0.1)
    assert set(detector.swings) == {Loop.YAW}


def test_after_a_change_it_has_to_go_on() -> None:
    detector, found_s = OscillationDetector(COAXIAL), []
    for k in range(300):
        stick = COAXIAL.hover_input.copy()
        stick[PITCH] += wave(2.0, 1.0)(k * PERIOD_S)
        loops = detector.observe(stick, None, still_at(under_way(k)), under_way(k), PERIOD_S)
        if loops:
            found_s.append(k * PERIOD_S)
            detector.changed(loops)
    assert np.diff(found_s) == pytest.approx(0.25 * HALF_WAVES_AGAIN, abs=0.03)
