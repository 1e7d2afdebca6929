"""Promises of the kernel that counts half-waves: what the same rules say in plain Python."""

import math
from dataclasses import dataclass

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.native.oscillation import (
    ALIKE,
    AWAY,
    CHANNEL,
    COUNT,
    COUNT_NEAR,
    FADING,
    LIMITS,
    LONGEST_HALF_WAVE_S,
    NEAR_M,
    NEAR_RAD,
    RESTING_M_S,
    SHORTEST_HALF_WAVE_S,
    SIGNALS,
    SMOOTHING_S,
    observe_swings,
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
    assert channels[:, COUNT].tolist() == [channel.count for channel in plain]
    assert channels[:, COUNT_NEAR].tolist() == [channel.count_near for channel in plain]
