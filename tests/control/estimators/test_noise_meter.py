"""The noise of a Tracker is measured while a vehicle moves, and filters expect it."""

import numpy as np
import pytest
from support.vehicle_types import COAXIAL

from rcopterx.control.estimators.extended_kalman import ExtendedKalmanEstimator
from rcopterx.control.estimators.noise import SMALLEST_WINDOW, NoiseMeter
from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.interfaces import Measurement

PERIOD_S = 0.02


def metered(
    deviation: float, swing_m: float = 0.0, outliers: bool = False, period_s: float = PERIOD_S
) -> float:
    random, meter = np.random.default_rng(5), NoiseMeter(1)
    for k in range(400):
        value = swing_m * np.sin(6.0 * k * period_s) + deviation * random.standard_normal()
        if outliers and k % 40 == 39:
            value += 0.05
        meter.observe(np.array([value]), period_s)
    assert meter.deviation is not None
    return float(meter.deviation[0])


@pytest.mark.parametrize("deviation", [0.0003, 0.002])
@pytest.mark.parametrize("period_s", [0.005, 0.02])
def test_noise_is_separated_from_motion(deviation: float, period_s: float) -> None:
    assert metered(deviation, swing_m=0.05, period_s=period_s) == pytest.approx(deviation, rel=0.2)


def test_motion_alone_is_no_noise() -> None:
    assert metered(0.0, swing_m=0.05) < 0.0001


def test_outliers_hardly_count() -> None:
    assert metered(0.001, outliers=True) < 0.002


def test_noise_is_unknown_at_first_and_for_irregular_poses() -> None:
    meter = NoiseMeter(1)
    for k in range(SMALLEST_WINDOW + 2):
        assert meter.deviation is None
        meter.observe(np.array([float(k % 2)]), PERIOD_S)
    irregular = NoiseMeter(1)
    for k in range(200):
        irregular.observe(np.array([float(k % 2)]), PERIOD_S * (1.0 + k % 2))
    assert irregular.deviation is None


def test_a_noise_that_begins_suddenly_is_measured_within_half_a_second() -> None:
    random, meter = np.random.default_rng(3), NoiseMeter(1)
    for deviation, frames in ((0.0003, 200), (0.002, 25)):
        for _ in range(frames):
            meter.observe(deviation * random.standard_normal(1), PERIOD_S)
    assert meter.deviation is not None
    assert meter.deviation[0] > 0.001


@pytest.mark.parametrize("noise", [0.2, 4.0])
def test_a_filter_expects_at_least_the_noise_of_its_settings(noise: float) -> None:
    settings = ExtendedKalmanSettings()
    estimator = ExtendedKalmanEstimator(COAXIAL, PERIOD_S, settings)
    random = np.random.default_rng(2)
    expected = []
    for _ in range(500):
        estimator.predict(COAXIAL.hover_input, PERIOD_S)
        position = np.array([0.0, 0.0, 1.0]) + noise * settings.position_noise_m * random.standard_normal(3)
        tilt = noise * settings.tilt_noise * random.standard_normal(2)
        estimator.correct(Measurement(position, 0.0, tilt))
        assert estimator.horizontal.selected is not None
        expected.append(np.sqrt(estimator.horizontal.selected.R[[0, 2]]))
    of_settings = np.array([settings.position_noise_m, settings.tilt_noise])
    usual = np.median(expected[100:], axis=0)
    assert usual == pytest.approx(max(noise, 1.0) * of_settings, rel=0.25)
