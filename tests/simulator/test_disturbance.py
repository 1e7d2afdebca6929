"""Promises of the seeded randomness."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.conditions import LABORATORY

from rcopterx.simulator.disturbance import (
    NOISE,
    TURBULENCE,
    ColouredNoise,
    random_stream,
)

GRID_S = 0.002


def laboratory_noise(seed: int, vehicle: str = "h1") -> ColouredNoise:
    generator = random_stream(seed, vehicle, TURBULENCE)
    return ColouredNoise(LABORATORY.turbulence_rms, LABORATORY.turbulence_correlation_s, GRID_S, generator)


def test_laboratory_turbulence_has_the_stated_rms_and_correlation_time() -> None:
    noise = laboratory_noise(0)
    samples = np.array([noise.at(0.05 * i) for i in range(20_000)])
    assert np.allclose(np.sqrt(np.mean(samples**2, axis=0)), LABORATORY.turbulence_rms, rtol=0.08)
    lag = 10
    correlation = np.mean(samples[lag:] * samples[:-lag], axis=0) / np.mean(samples**2, axis=0)
    assert np.allclose(correlation, np.exp(-1.0), atol=0.08)


def test_turbulence_channels_are_independent() -> None:
    noise = laboratory_noise(1)
    samples = np.array([noise.at(0.25 * i) for i in range(4_000)])
    correlation = np.corrcoef(samples.T)
    assert np.all(np.abs(correlation - np.eye(4)) < 0.1)


@given(seed=st.integers(0, 1000), steps=st.lists(st.floats(1e-4, 0.03), min_size=1, max_size=30))
def test_turbulence_is_a_function_of_seed_and_time_alone(seed: int, steps: list[float]) -> None:
    many, one = laboratory_noise(seed), laboratory_noise(seed)
    times = np.cumsum(steps)
    for time_s in times:
        last = many.at(float(time_s))
    assert last == one.at(float(times[-1]))


@given(seed=st.integers(0, 1000))
def test_streams_differ_between_vehicles_and_purposes(seed: int) -> None:
    draws = {
        float(random_stream(seed, vehicle, purpose).standard_normal())
        for vehicle in ("h1", "h2")
        for purpose in (TURBULENCE, NOISE)
    }
    assert len(draws) == 4


@given(
    seed=st.integers(0, 1000),
    channels=st.integers(1, 5),
    pauses=st.lists(st.sampled_from((0.001, 0.01, 1.7)), min_size=1, max_size=20),
)
def test_turbulence_advances_by_one_number_for_each_channel_and_step(
    seed: int, channels: int, pauses: list[float]
) -> None:
    rms = np.array((0.1, 0.2, 0.3, 0.4, 0.5)[:channels])
    noise = ColouredNoise(tuple(rms), 0.5, 0.004, random_stream(seed, "h1", TURBULENCE))
    generator = random_stream(seed, "h1", TURBULENCE)
    value, index = rms * generator.standard_normal(channels), 0
    keep, renew = math.exp(-0.004 / 0.5), math.sqrt(-math.expm1(-2 * 0.004 / 0.5))
    for time_s in np.cumsum(pauses).tolist():
        while index < int(time_s / 0.004):
            value = keep * value + renew * rms * generator.standard_normal(channels)
            index += 1
        assert noise.at(time_s) == pytest.approx(value, rel=1e-12)
