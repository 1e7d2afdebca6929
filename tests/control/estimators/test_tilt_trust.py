"""A measured tilt that contradicts the motion is detected, and not used until it agrees again."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.conditions import IDEAL
from support.vehicle_types import COAXIAL

from rcopterx.control.estimators.extended_kalman import DISTRUSTED, TRUSTED_AGAIN, ExtendedKalmanEstimator
from rcopterx.control.estimators.noise import TiltTrust
from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.interfaces import Measurement
from rcopterx.simulator.helicopter import Helicopter
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import Array, heading_matrix

PERIOD_S = 0.02
OFFSET = np.array([0.05, -0.03])


def swing(time_s: float, size: float = 0.03) -> Array:
    return size * np.array([np.sin(5.0 * time_s), np.cos(3.0 * time_s)])


def watch(
    trust: TiltTrust,
    measured: Callable[[float], Array],
    seconds: float,
    size: float = 0.03,
    yaw_rad: float = 0.0,
) -> None:
    random = np.random.default_rng(1)
    for time_s in np.arange(0.0, seconds, PERIOD_S):
        noise = 0.3 * size * random.standard_normal(2)
        expected = swing(time_s, size) + noise
        turned = heading_matrix(yaw_rad)
        trust.observe(turned @ measured(time_s), turned @ expected, yaw_rad, PERIOD_S)


def test_a_tilt_that_swings_with_the_expected_one_is_trusted_however_the_markers_sit() -> None:
    trust = TiltTrust()
    watch(trust, lambda time_s: OFFSET + swing(time_s), 20.0)
    assert trust.trusted


@pytest.mark.parametrize(
    "wrong",
    [
        lambda _: np.zeros(2),
        lambda _: OFFSET,
        lambda time_s: swing(time_s)[::-1],
        lambda time_s: -swing(time_s),
    ],
    ids=["level", "frozen", "axes swapped", "inverted"],
)
def test_a_tilt_that_does_not_is_distrusted_until_it_does_again(wrong: Callable[[float], Array]) -> None:
    trust = TiltTrust()
    watch(trust, wrong, 4.0)
    assert not trust.trusted
    watch(trust, wrong, 10.0)
    assert not trust.trusted
    watch(trust, lambda time_s: OFFSET + swing(time_s), 15.0)
    assert trust.trusted


def test_tilts_are_compared_as_seen_from_the_vehicle() -> None:
    concordances = []
    for yaw_rad in (0.0, 1.3):
        trust = TiltTrust()
        watch(trust, lambda time_s: OFFSET + 0.5 * swing(time_s), 5.0, yaw_rad=yaw_rad)
        concordances.append(trust.concordance)
    assert concordances[0] == pytest.approx(concordances[1])


def test_nothing_is_judged_while_the_vehicle_hardly_moves() -> None:
    trust = TiltTrust()
    watch(trust, lambda _: np.zeros(2), 10.0, size=0.004)
    assert trust.concordance is None
    assert trust.trusted


def fly(estimator: ExtendedKalmanEstimator, plant: Helicopter, seconds: float, level: bool) -> float:
    """Swing to and fro; return the root mean square error of the tilt in the last two seconds."""
    errors = []
    trim = plant.parameters.trim
    for step in range(round(seconds / PERIOD_S)):
        pitch, roll = 0.12 * np.sin(5.0 * step * PERIOD_S), 0.12 * np.sin(4.0 * step * PERIOD_S + 1.0)
        stick = (pitch - trim[0], roll - trim[1], 9.81 / 18.0, -trim[3])
        plant.set_input(stick)
        plant.advance(PERIOD_S)
        estimator.predict(np.array(stick), PERIOD_S)
        pose = plant.pose
        true = np.array([np.sin(pose.pitch_rad), -np.sin(pose.roll_rad)])
        c, s = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
        true = np.array([[c, -s], [s, c]]) @ true
        measured = np.zeros(2) if level else true
        estimator.correct(Measurement(np.array(pose.position_m), pose.yaw_rad, measured))
        tilt = estimator.estimate.tilt
        errors.append(tilt.core[:2] - true)
    return float(np.sqrt(np.mean(np.square(errors[-round(2.0 / PERIOD_S) :]))))


def test_a_vehicle_whose_tracker_reports_it_level_is_estimated_by_its_positions_meanwhile() -> None:
    calm = replace(IDEAL, transport_delay_s=0.0)
    plant = Helicopter("h1", COAXIAL, calm, 0, BodyPose((0.0, 0.0, 3.0)), HelicopterParameters.nominal(0.78))
    estimator = ExtendedKalmanEstimator(COAXIAL, PERIOD_S, ExtendedKalmanSettings())
    estimator.reset(Measurement(np.array([0.0, 0.0, 3.0]), 0.0, np.zeros(2)))
    exact = fly(estimator, plant, 4.0, level=False)
    assert not estimator.events
    blind = fly(estimator, plant, 6.0, level=True)
    assert dict(estimator.events) == {DISTRUSTED: 1}
    assert exact < 0.005
    assert blind < 0.02
    assert fly(estimator, plant, 9.0, level=False) < 0.005
    assert dict(estimator.events) == {DISTRUSTED: 1, TRUSTED_AGAIN: 1}
