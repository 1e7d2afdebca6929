"""Promises of the kernels that watch a flight: what the same rules say in plain Python."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.native.watching import (
    ALIKE,
    AWAY,
    AXIS_AT_FAULT,
    AXIS_PATIENCE_S,
    CHANNEL,
    EFFECT,
    FADING,
    GAIN,
    HOVER_THRUST,
    KNOWN,
    LEARNT_GAIN,
    LIMITS,
    LONGEST_HALF_WAVE_S,
    NEAR_M,
    NEAR_RAD,
    RESTING_M_S,
    SHORTEST_HALF_WAVE_S,
    SIGNALS,
    SMOOTHING_S,
    SOUND,
    WAVES,
    WAVES_NEAR,
    observe_swings,
    watch_effects,
)

PERIOD_S = 0.02


@dataclass
class Channel:
    """Half-waves of one signal: (length, size) of the last two, None for none."""

    limits: np.ndarray
    side: int = 0
    count: int = 0
    count_near: int = 0
    away: float = 0.0
    since_s: float = 0.0
    size: float = 0.0
    older: tuple[float, float] | None = None
    last: tuple[float, float] | None = None

    def observe(self, value: float, near: bool) -> bool:
        rest, threshold, needed_near, needed = self.limits
        self.away += PERIOD_S / (PERIOD_S + SMOOTHING_S) * (value - rest - self.away)
        self.since_s += PERIOD_S
        side = int(np.sign(self.away))
        begins = abs(self.away) > threshold and side != self.side
        if begins:
            self.begin(side)
        self.size = max(self.size, abs(self.away))
        if self.since_s > LONGEST_HALF_WAVE_S:
            self.count = self.count_near = 0
        if not near:
            self.count_near = 0
        return bool(begins and (self.count_near >= needed_near or self.count >= needed))

    def begin(self, side: int) -> None:
        follows = self.side != 0 and SHORTEST_HALF_WAVE_S <= self.since_s <= LONGEST_HALF_WAVE_S
        alike = True
        if self.older is not None:
            ratio = self.since_s / self.older[0]
            alike = max(ratio, 1.0 / ratio) <= ALIKE and self.size >= FADING * self.older[1]
        self.count = 1 if not follows else self.count + 1 if alike else max(self.count - 1, 1)
        self.count_near = min(self.count_near + 1, self.count)
        self.older, self.last = self.last, (self.since_s, self.size) if follows else None
        self.side, self.since_s, self.size = side, 0.0, 0.0


@given(st.integers(0, 10_000), st.booleans())
def test_half_waves_are_counted_by_the_rules(seed: int, tilted: bool) -> None:
    rng = np.random.default_rng(seed)
    limits = np.empty((2 * SIGNALS, LIMITS))
    limits[:, 0], limits[:, 1] = rng.normal(size=2 * SIGNALS), rng.uniform(0.1, 0.5, size=2 * SIGNALS)
    limits[:, 2], limits[:, 3] = rng.integers(2, 4, size=2 * SIGNALS), rng.integers(3, 6, size=2 * SIGNALS)
    limits[SIGNALS:, 0] = limits[:SIGNALS, 0]
    plain = [Channel(row) for row in limits]
    channels, place, reference = np.zeros((2 * SIGNALS, CHANNEL)), np.full(4, np.nan), np.zeros(4)
    frequencies, phases = rng.uniform(0.4, 5.5, size=SIGNALS), rng.uniform(0.0, 6.0, size=SIGNALS)
    rested = False
    for step in range(150):
        swings = 0.7 * np.sin(math.tau * frequencies * step * PERIOD_S + phases)
        signals = limits[:SIGNALS, 0] + swings + 0.1 * rng.normal(size=SIGNALS)
        before, moving = reference.copy(), step in (0, 40, 41, 42, 110)
        reference[:3] += moving * 1.5 * RESTING_M_S * PERIOD_S
        resting = step > 0 and bool((np.abs(reference - before)[:3] < RESTING_M_S * PERIOD_S).all())
        if rested and not resting:
            plain[SIGNALS:] = [Channel(row) for row in limits[SIGNALS:]]
        rested, away = resting, np.array([0.3, 0.2, 0.1, 0.5]) * (1.5 if 70 <= step < 90 else 1.0)
        near = math.hypot(*away[:3]) < NEAR_M and away[3] < NEAR_RAD
        motion = np.append(reference + away, rng.normal(size=4))
        tilt = signals[4:] if tilted else np.empty(0)
        seen = observe_swings(channels, limits, place, signals[:4], tilt, motion, reference, PERIOD_S)
        values = np.append(signals[:4], tilt if tilted else np.zeros(2))
        watched = range(2 * SIGNALS if resting else SIGNALS)
        told = [plain[number].observe(values[number % SIGNALS], near) for number in watched]
        assert seen == sum(1 << number for number in watched if told[number])
    assert np.array_equal(channels[:, AWAY], [channel.away for channel in plain])
    assert channels[:, WAVES].tolist() == [channel.count for channel in plain]
    assert channels[:, WAVES_NEAR].tolist() == [channel.count_near for channel in plain]


@given(st.integers(0, 10_000))
def test_effects_are_what_sticks_have_done_over_what_they_asked_for(seed: int) -> None:
    rng, periods, back = np.random.default_rng(seed), 70, 30
    gains, damping, poles = rng.uniform(9.0, 12.0, 4), -rng.uniform(0.1, 0.5, 4), rng.uniform(0.3, 0.8, 4)
    effects = rng.choice([1.0, 0.5], size=4)
    vehicle = np.concatenate((gains, damping, poles, [9.81]))
    least = np.concatenate((np.full((2, 4), 0.1), np.full((2, 4), 0.05)))
    memory, moments = np.zeros((5, 4)), np.empty((51, 10))
    memory[3:] = np.inf
    known, rules = np.zeros(KNOWN), np.array([2.0, 0.6, 10.0])
    known[HOVER_THRUST] = known[LEARNT_GAIN] = np.nan
    motion, lagged, sticks = np.zeros(8), np.zeros(4), np.zeros((periods, 4))
    sticks[:] = rng.uniform(0.6, 0.9, size=4)
    lagged[:] = sticks[0]
    for number in range(periods):
        arguments = sticks[number], sticks[number], motion.copy(), PERIOD_S, memory, moments, number, back
        assert watch_effects(vehicle, least, *arguments, rules, known) == SOUND
        lagged = sticks[number] + poles * (lagged - sticks[number])
        rates = motion[4:].copy()
        turning = np.array([rates[3] * rates[1], -rates[3] * rates[0], -9.81, 0.0])
        motion[4:] += PERIOD_S * (effects * gains * lagged + damping * rates + turning)
        motion[2] += PERIOD_S * rates[2]
    assert memory[0] == pytest.approx(lagged)
    assert known[EFFECT : EFFECT + 3] == pytest.approx(effects[[0, 1, 3]])
    assert known[GAIN] == pytest.approx(effects[2])
    assert known[HOVER_THRUST] == pytest.approx(0.6 / effects[2])


def test_a_stick_without_effect_is_certain_after_some_time() -> None:
    vehicle = np.concatenate((np.full(4, 8.0), np.zeros(4), np.zeros(4), [9.81]))
    least = np.concatenate((np.full((2, 4), 0.1), np.full((2, 4), 0.05)))
    memory, moments, known = np.zeros((5, 4)), np.empty((51, 10)), np.zeros(KNOWN)
    memory[3:] = np.inf
    stick, motion, found = np.array([0.0, 0.9, 0.0, 0.0]), np.zeros(8), []
    for number in range(50):
        arguments = stick, stick, motion, PERIOD_S, memory, moments, number, 20
        found.append(watch_effects(vehicle, least, *arguments, np.array([2.0, 0.6, 10.0]), known))
    first = next(number for number, what in enumerate(found) if what != SOUND)
    assert found[first] == AXIS_AT_FAULT + 1
    assert first == pytest.approx(20 + AXIS_PATIENCE_S / PERIOD_S, abs=2)
