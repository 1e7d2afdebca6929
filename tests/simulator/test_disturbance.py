"""Promises of the seeded randomness."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.simulator.conditions import LABORATORY
from rcopterx.simulator.disturbance import (
    NOISE,
    TURBULENCE,
    ColouredNoise,
    NormalSource,
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


@given(counts=st.lists(st.integers(0, 9), min_size=1, max_size=200))
def test_numbers_do_not_depend_on_how_many_are_taken_at_once(counts: list[int]) -> None:
    one, many = (NormalSource(random_stream(0, "h1", NOISE)) for _ in range(2))
    for count in counts:
        assert many.take(count) == [one() for _ in range(count)]
