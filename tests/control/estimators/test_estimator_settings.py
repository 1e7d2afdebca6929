"""The noise of the filter is that of the model's uncertainty, and of the gusts of its flights."""

from dataclasses import replace

import pytest
from support.vehicle_types import COAXIAL

from rcopterx.control.estimators.settings import ExtendedKalmanSettings, Noise, noise_of
from rcopterx.vehicles.model import CALM, IDENTIFIED

DEFAULT = ExtendedKalmanSettings()
KNOWN = replace(COAXIAL, uncertainty=IDENTIFIED)


def noise(density: float, settings: ExtendedKalmanSettings = DEFAULT) -> Noise:
    return noise_of(replace(KNOWN, gust_density=density), settings)


def test_the_more_gusts_a_flight_shows_the_less_is_compensated_as_wind() -> None:
    winds = [noise(factor * CALM).wind_rms_m_s2 for factor in (2.0, 3.0, 5.0, 10.0, 30.0)]
    assert winds == sorted(winds, reverse=True)
    assert winds == pytest.approx([0.5, 0.37, 0.25, 0.15, 0.15], abs=0.01)


def test_gusts_as_of_a_closed_room_change_nothing() -> None:
    assert noise(0.1 * CALM) == noise(CALM) == noise(2.0 * CALM) == noise_of(KNOWN, DEFAULT)


def test_gusts_move_the_vehicle_and_nothing_else() -> None:
    calm, gusty = noise(CALM), noise(0.1)
    assert gusty.velocity_noise == (0.1, 0.1, *calm.velocity_noise[2:])
    assert gusty.tilt_density == calm.tilt_density
    assert gusty.actuator_noise == calm.actuator_noise


def test_a_type_stays_as_quick_as_its_uncertainty_needs() -> None:
    assert noise_of(COAXIAL, DEFAULT) == noise_of(replace(COAXIAL, gust_density=0.5 * CALM), DEFAULT)


def test_settings_and_missing_tilts_come_first() -> None:
    assert noise(0.1, ExtendedKalmanSettings(wind_rms_m_s2=0.7)).wind_rms_m_s2 == 0.7
    blind = ExtendedKalmanSettings(measured_tilt=False)
    assert noise(0.1, blind) == noise(CALM, blind)
