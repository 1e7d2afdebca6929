"""Promises of the lateral system: it is the tilt model between a demand and a position, at any period."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.conditions import IDEAL
from support.demand import demand_matrix
from support.vehicle_types import COAXIAL, COAXIAL_LAG

from rcopterx.control.interfaces import Estimate, TiltEstimate
from rcopterx.control.models.lateral import (
    POSITION,
    VELOCITY,
    WIND_CORRELATION_S,
    LateralSystem,
    predict_lateral,
)
from rcopterx.control.models.prediction import predict
from rcopterx.simulator.helicopter import Helicopter
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import heading_matrix

PERIOD_S = 0.02
sticks = st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(np.array)
headings = st.floats(-7.0, 7.0)


def state_of(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 0.1, LateralSystem(COAXIAL, PERIOD_S).size)


@given(st.integers(0, 1000), sticks, st.floats(0.002, 0.05))
def test_two_half_periods_are_one(seed: int, demand: np.ndarray, period_s: float) -> None:
    whole, half = LateralSystem(COAXIAL, period_s), LateralSystem(COAXIAL, period_s / 2)
    once = whole.transition @ state_of(seed) + whole.demand @ demand
    twice = state_of(seed)
    for _ in range(2):
        twice = half.transition @ twice + half.demand @ demand
    assert twice == pytest.approx(once, abs=1e-9)


@given(st.integers(0, 1000), headings)
def test_no_direction_is_preferred(seed: int, yaw_rad: float) -> None:
    system = LateralSystem(COAXIAL, PERIOD_S)
    whole = np.kron(np.eye(system.size // 2), heading_matrix(yaw_rad))
    state = state_of(seed)
    assert system.transition @ (whole @ state) == pytest.approx(whole @ (system.transition @ state))


def test_wind_fades_with_its_correlation_time_and_pushes_the_vehicle() -> None:
    system = LateralSystem(COAXIAL, PERIOD_S)
    state = np.zeros(system.size)
    state[system.wind] = 1.0, 0.0
    after = system.transition @ state
    assert after[system.wind] == pytest.approx([np.exp(-PERIOD_S / WIND_CORRELATION_S), 0.0])
    assert after[VELOCITY][0] == pytest.approx(PERIOD_S, rel=0.05)
    assert after[POSITION][0] > 0.0


def test_a_vehicle_with_lags_has_no_lateral_system() -> None:
    with pytest.raises(ValueError, match="no tilt"):
        LateralSystem(COAXIAL_LAG, PERIOD_S)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -2.5])
def test_the_model_predicts_the_simulated_helicopter_of_its_size(yaw_rad: float) -> None:
    """Half a second of stick on the nonlinear plant: structure and signs agree, figures within a fifth."""
    plant = Helicopter(
        "h1", COAXIAL, IDEAL, 0, BodyPose((0.0, 0.0, 1.0), yaw_rad), HelicopterParameters.nominal(0.78)
    )
    trim = np.array(plant.parameters.trim[:2])
    stick = np.array([0.2, -0.1])
    hover = np.array([*-trim, 9.81 / 18.0, -plant.parameters.trim[3]])
    plant.set_input(hover + np.array([*stick, 0.0, 0.0]))
    plant.advance(0.02 + 0.5)
    motion = np.zeros(8)
    motion[3] = yaw_rad
    estimate = Estimate(
        motion,
        COAXIAL.hover_input,
        np.zeros(4),
        TiltEstimate(np.zeros(6), np.zeros(2), np.zeros(2), np.zeros(2)),
    )
    for _ in range(25):
        estimate = predict(COAXIAL, estimate, np.array([*stick, COAXIAL.hover_input[2], 0.0]), PERIOD_S)
    true_m, found_m = np.array(plant.motion[:2]), estimate.motion[:2]
    assert np.linalg.norm(true_m) > 0.02
    assert np.linalg.norm(found_m - true_m) < 0.2 * np.linalg.norm(true_m)


@given(st.integers(0, 1000), sticks, sticks, headings)
def test_a_vehicle_answers_the_demand_of_its_sticks_and_trims(
    seed: int, stick: np.ndarray, trim: np.ndarray, yaw_rad: float
) -> None:
    system, per_stick = LateralSystem(COAXIAL, PERIOD_S), demand_matrix(COAXIAL, yaw_rad)
    state = np.concatenate((state_of(seed), trim, [7.0]))
    demanded = state[: system.size].copy()
    demanded[system.servo] = per_stick @ demanded[system.servo]
    demanded = system.transition @ demanded + system.demand @ (per_stick @ (stick + trim))
    demanded[system.servo] = np.linalg.solve(per_stick, demanded[system.servo])
    after, F = predict_lateral(system.step, state, stick, yaw_rad)
    assert after == pytest.approx(np.concatenate((demanded, trim, [7.0])), abs=1e-12)
    without_stick, _ = predict_lateral(system.step, state, np.zeros(2), yaw_rad)
    assert F @ state == pytest.approx(without_stick, abs=1e-12)
