"""The noise under which a flight is likeliest is that of the flight."""

from dataclasses import replace

import numpy as np
import pytest
from support.simulated_flight import simulated_flight
from support.vehicle_types import COAXIAL

from rcopterx.control.identification.likelihood import likeliest
from rcopterx.control.identification.motions import Candidate, Offsets, horizontal, unexplained
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.vehicles.model import Model, Unexplained

assert COAXIAL.tilt is not None
STIFF = replace(COAXIAL, tilt=replace(COAXIAL.tilt, flapping_rad_s_m=0.0))
KNOWN = Candidate(STIFF, Offsets((0.01, -0.02), (0.03, -0.04)))


@pytest.fixture(scope="module")
def flight() -> FlightRecording:
    return simulated_flight(STIFF)


def improbability(model: Model, flight: FlightRecording) -> float:
    return horizontal(replace(KNOWN, model=model), flight).improbability()


def test_noise_and_wind_of_a_flight_are_found(flight: FlightRecording) -> None:
    found = likeliest(KNOWN, [flight])
    assert found.position_m == pytest.approx(0.0003, rel=0.15)
    assert found.tilt == pytest.approx(0.002, rel=0.15)
    assert found.wind_m_s2 == pytest.approx(0.1, rel=0.4)
    assert found.velocity_density < 0.02
    usual = improbability(STIFF, flight)
    assert improbability(replace(STIFF, unexplained=found), flight) < usual - 100.0


def test_gusts_are_found_beside_the_wind(flight: FlightRecording) -> None:
    random, period_s = np.random.default_rng(3), flight.period_s
    gusty, velocity_m_s = flight.position_m.copy(), np.zeros(2)
    moved_m = np.zeros(2)
    for row in range(len(gusty)):
        gusty[row, :2] += moved_m
        moved_m += period_s * velocity_m_s
        kick_m_s = 0.1 * np.sqrt(period_s) * random.standard_normal(2)
        velocity_m_s += period_s * STIFF.k[:2].mean() * velocity_m_s + kick_m_s
    found = likeliest(KNOWN, [replace(flight, position_m=gusty)])
    assert found.velocity_density == pytest.approx(0.1, rel=0.25)


def test_what_a_model_is_known_to_miss_is_expected() -> None:
    shown = Unexplained(0.001, 0.002, 0.003, 0.004, 0.005)
    assert unexplained(replace(COAXIAL, unexplained=shown)) == shown
    assert unexplained(COAXIAL).tilt_density > unexplained(STIFF).tilt_density


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("inf"), float("nan")])
def test_noise_is_above_zero(wrong: float) -> None:
    with pytest.raises(ValueError, match="tilt_density: must be above 0"):
        Unexplained(0.001, 0.002, 0.003, wrong, 0.005)
