"""Promises of the tilt filter: it finds tilt, trim and crooked markers, with or without a measured tilt."""

import dataclasses
from collections.abc import Callable
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.demand import demand_matrix
from support.records import replace
from support.vehicle_types import COAXIAL

from rcopterx.control.estimators.extended_kalman import (
    LEVER_ARM_FOUND,
    ExtendedKalmanEstimator,
    HorizontalMotion,
)
from rcopterx.control.estimators.filters import OFFSET_LIMIT_RAD, TiltFilter
from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.models.lateral import POSITION, LateralSystem
from rcopterx.control.plugins import ESTIMATORS
from rcopterx.vehicles.state import heading_matrix

PERIOD_S = 0.02
OFFSET = slice(-3, -1)
"""States of the offset of the body frame."""


def new_filter(lever_arm_m: float = 0.0, deviation_m: float = 0.02) -> TiltFilter:
    settings = ExtendedKalmanSettings(
        velocity_noise=4 * (0.01,),
        tilt_density=2.0,
        wind_rms_m_s2=0.15,
        lever_arm_deviation_m=deviation_m,
    )
    return TiltFilter(dataclasses.replace(COAXIAL, lever_arm_m=lever_arm_m), settings)


class Vehicle:
    """The model itself, with a trim, markers glued on crookedly, and a heading."""

    def __init__(self, yaw_rad: float, trim: np.ndarray, offset_rad: np.ndarray) -> None:
        self.system = LateralSystem(COAXIAL, PERIOD_S)
        self.state = np.zeros(self.system.size)
        self.yaw_rad, self.trim, self.offset_rad = yaw_rad, trim, offset_rad

    def fly(self, stick: np.ndarray) -> None:
        demand = demand_matrix(COAXIAL, self.yaw_rad) @ (stick + self.trim)
        self.state = self.system.transition @ self.state + self.system.demand @ demand

    @property
    def measured_tilt(self) -> np.ndarray:
        return self.state[self.system.tilt] + heading_matrix(self.yaw_rad) @ self.offset_rad


@settings(max_examples=15, deadline=None)
@given(
    st.floats(-3.0, 3.0),
    st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)),
    st.tuples(st.floats(-0.08, 0.08), st.floats(-0.08, 0.08)),
    st.integers(0, 99),
)
def test_state_trim_and_body_frame_are_found(
    yaw_rad: float, trim: tuple[float, float], offset: tuple[float, float], seed: int
) -> None:
    vehicle = Vehicle(yaw_rad, np.array(trim), np.array(offset))
    found = new_filter()
    found.stand(np.zeros(2), heading_matrix(yaw_rad) @ np.array(offset) + 0.01, yaw_rad)
    rng = np.random.default_rng(seed)
    for _ in range(1500):
        # a controller that keeps the vehicle near, with some excitation
        body = heading_matrix(yaw_rad).T @ (-1.0 * vehicle.state[:2] - 1.5 * vehicle.state[2:4])
        stick = np.clip(0.3 * body, -0.2, 0.2) - vehicle.trim + rng.normal(0.0, 0.03, 2)
        vehicle.fly(stick)
        found.predict(stick, yaw_rad, PERIOD_S)
        found.correct(vehicle.state[POSITION], vehicle.measured_tilt, yaw_rad)
    tilt = vehicle.state[vehicle.system.tilt]
    assert found.x[:2] == pytest.approx(vehicle.state[:2], abs=1e-3)
    assert found.x[2:4] == pytest.approx(vehicle.state[2:4], abs=0.01)
    assert found.estimate.core[:2] == pytest.approx(tilt, abs=0.006)
    assert found.estimate.trim == pytest.approx(vehicle.trim, abs=0.012)
    assert found.x[OFFSET] == pytest.approx(vehicle.offset_rad, abs=0.008)
    assert np.linalg.eigvalsh(found.P).min() > 0.0


def test_without_a_measured_tilt_the_state_is_found_from_positions() -> None:
    vehicle = Vehicle(0.4, np.array([0.02, -0.01]), np.zeros(2))
    found = new_filter()
    found.start(np.zeros(2), np.zeros(2), None, 0.4)
    for step in range(1000):
        stick = -vehicle.trim + 0.05 * np.array([np.sin(step / 9), np.cos(step / 13)])
        vehicle.fly(stick)
        found.predict(stick, 0.4, PERIOD_S)
        found.correct(vehicle.state[POSITION], None, 0.4)
    assert found.x[2:4] == pytest.approx(vehicle.state[2:4], abs=0.02)
    assert found.estimate.core[:2] == pytest.approx(vehicle.state[vehicle.system.tilt], abs=0.02)


def flown_with_lever(found: TiltFilter, lever_arm_m: float, measured: bool = True) -> Vehicle:
    """Fly a vehicle for 30 s whose origin is above its centre of gravity."""
    vehicle, rng = Vehicle(0.4, np.zeros(2), np.zeros(2)), np.random.default_rng(1)
    found.start(np.zeros(2), np.zeros(2), np.zeros(2) if measured else None, 0.4)
    for step in range(1500):
        stick = 0.05 * np.array([np.sin(step / 9), np.cos(step / 13)]) + rng.normal(0.0, 0.02, 2)
        vehicle.fly(stick)
        found.predict(stick, 0.4, PERIOD_S)
        tilt = vehicle.measured_tilt
        found.correct(vehicle.state[POSITION] + lever_arm_m * tilt, tilt if measured else None, 0.4)
    return vehicle


@pytest.mark.parametrize("lever_arm_m", [-0.04, 0.03])
def test_a_lever_arm_is_found_in_flight_where_the_tilt_is_measured(lever_arm_m: float) -> None:
    found = new_filter()
    vehicle = flown_with_lever(found, lever_arm_m)
    length_m, deviation_m = found.lever_arm_m
    assert length_m == pytest.approx(lever_arm_m, abs=0.004)
    assert deviation_m < 0.004
    assert found.x[POSITION] == pytest.approx(vehicle.state[POSITION], abs=5e-4)


@pytest.mark.parametrize("measured", [True, False])
def test_a_lever_arm_of_the_model_is_kept_where_it_is_certain(measured: bool) -> None:
    found = new_filter(-0.04, 0.0)
    vehicle = flown_with_lever(found, -0.04, measured)
    assert found.lever_arm_m == (-0.04, 0.0)
    assert found.x[POSITION] == pytest.approx(vehicle.state[POSITION], abs=1e-3)


@pytest.mark.parametrize("lever_arm_m", [-0.04, 0.0, 0.03])
def test_the_filter_with_a_lever_arm_is_used_once_it_explains_the_poses_much_better(
    lever_arm_m: float,
) -> None:
    motion = HorizontalMotion(COAXIAL, ExtendedKalmanSettings())
    vehicle, rng = Vehicle(0.4, np.zeros(2), np.zeros(2)), np.random.default_rng(1)
    motion.stand(np.array((0.0, 0.0, 1.0, 0.4)), np.zeros(2))
    before = motion.selected
    for step in range(1500):
        stick = 0.15 * np.array([np.sin(step / 4), np.cos(step / 6)]) + rng.normal(0.0, 0.02, 2)
        vehicle.fly(stick)
        for each in motion.filters:
            each.predict(stick, 0.4, PERIOD_S)
        tilt = vehicle.measured_tilt
        pose = np.array((*(vehicle.state[POSITION] + lever_arm_m * tilt), 1.0, 0.4))
        motion.correct(pose, tilt, 0.0005, PERIOD_S)
    assert motion.events[LEVER_ARM_FOUND] == (lever_arm_m != 0.0)
    assert (motion.selected is before) == (lever_arm_m == 0.0)
    assert motion.selected is not None
    assert motion.selected.lever_arm_m[0] == pytest.approx(lever_arm_m, abs=0.004)
    motion.stand(np.array((0.0, 0.0, 0.0, 0.4)), np.zeros(2))
    assert motion.selected is before


def test_a_tilt_of_markers_mixed_up_is_rejected() -> None:
    found = new_filter()
    found.start(np.zeros(2), np.zeros(2), np.zeros(2), 0.0)
    found.predict(np.zeros(2), 0.0, PERIOD_S)
    found.correct(np.zeros(2), np.array([0.9, 0.0]), 0.0)
    assert np.abs(found.estimate.core).max() < 1e-6


def test_a_standing_vehicle_shows_how_its_markers_are_glued_on() -> None:
    found = new_filter()
    found.stand(np.zeros(2), np.array([0.05, -0.02]), 0.0)
    assert found.x[OFFSET] == pytest.approx([0.05, -0.02])
    assert found.estimate.core[:2] == pytest.approx([0.0, 0.0])
    found.stand(np.zeros(2), np.array([0.9, 0.0]), 0.0)
    assert np.abs(found.x[OFFSET]).max() <= OFFSET_LIMIT_RAD


def test_a_helicopter_estimates_its_tilt_and_can_do_without_measuring_it() -> None:
    for settings_of in ({}, {"measured_tilt": False}):
        estimator = ESTIMATORS.build("extended_kalman", COAXIAL, PERIOD_S, settings_of)
        assert isinstance(estimator, ExtendedKalmanEstimator)
        estimator.reset(Measurement(np.array([0.0, 0.0, 1.0]), 0.0, np.array([0.04, 0.0])))
        expected = 0.04 if not settings_of else 0.0
        assert estimator.horizontal.selected is not None
        assert estimator.horizontal.selected.x[OFFSET][0] == pytest.approx(expected)


def test_an_estimate_of_a_helicopter_stays_what_it_was() -> None:
    estimator = ESTIMATORS.build("extended_kalman", COAXIAL, PERIOD_S, {})
    assert isinstance(estimator, ExtendedKalmanEstimator)
    estimator.reset(Measurement(np.array([0.0, 0.0, 1.0]), 0.0, np.zeros(2)))
    changes: list[Callable[[], object]] = [
        lambda: estimator.predict(COAXIAL.hover_input, PERIOD_S),
        lambda: estimator.predict(COAXIAL.hover_input + np.array([0.2, 0.0, 0.0, 0.0]), PERIOD_S),
        lambda: estimator.correct(Measurement(np.array([0.002, 0.0, 1.0]), 0.0, np.array([0.05, 0.0]))),
        lambda: estimator.take_over(replace(estimator.estimate, motion=np.full(8, 0.1))),
        lambda: estimator.reset(Measurement(np.array([0.3, 0.0, 1.0]), 0.0, np.array([0.1, 0.0]))),
    ]
    for change in changes:
        before = estimator.estimate
        kept = deepcopy(before)
        change()
        assert_same(before, kept)


def assert_same(one: Estimate, other: Estimate) -> None:
    assert one.has_tilt
    assert other.has_tilt
    for name in ("motion", "actuator", "disturbance"):
        assert (getattr(one, name) == getattr(other, name)).all()
    for name in ("core", "servo", "wind_m_s2", "trim"):
        assert (getattr(one.tilt, name) == getattr(other.tilt, name)).all()
