"""The noise of the filter is that of the model's uncertainty, and of the gusts that its flights show."""

from dataclasses import replace

import pytest
from support.vehicle_types import COAXIAL

from rcopterx.control.estimators.settings import CALM_DENSITY, ExtendedKalmanSettings, Noise, noise_of
from rcopterx.vehicles.model import IDENTIFIED, Unexplained

DEFAULT = ExtendedKalmanSettings()
KNOWN = replace(COAXIAL, uncertainty=IDENTIFIED)


def noise(velocity_density: float, settings: ExtendedKalmanSettings = DEFAULT) -> Noise:
    shown = Unexplained(0.0001, 0.002, velocity_density, 0.2, 0.15)
    return noise_of(replace(KNOWN, unexplained=shown), settings)


def test_in_calm_air_the_filter_is_as_quick_as_its_certainty_allows() -> None:
    assert noise(0.5 * CALM_DENSITY) == noise_of(KNOWN, DEFAULT)


def test_the_more_gusts_a_flight_shows_the_less_is_compensated_as_wind() -> None:
    winds = [noise(factor * CALM_DENSITY).wind_rms_m_s2 for factor in (1.0, 2.0, 5.0, 10.0, 30.0)]
    assert winds == sorted(winds, reverse=True)
    assert winds[-2:] == pytest.approx([0.15, 0.15])
    assert noise(0.1).velocity_noise == (0.1, 0.1, *noise_of(KNOWN, DEFAULT).velocity_noise[2:])
    assert noise(0.1).tilt_density == noise_of(KNOWN, DEFAULT).tilt_density


def test_settings_and_missing_tilts_come_first() -> None:
    given = ExtendedKalmanSettings(wind_rms_m_s2=0.7)
    assert noise(0.1, given).wind_rms_m_s2 == 0.7
    blind = ExtendedKalmanSettings(measured_tilt=False)
    assert noise(0.1, blind) == noise_of(KNOWN, blind)
