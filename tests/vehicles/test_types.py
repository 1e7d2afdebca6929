"""Promises of the vehicle types that come with the package."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.equation_one import motion_derivative

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.types import (
    COAXIAL,
    COAXIAL_LAG,
    QUADROTOR,
    TILT_LIMIT_RAD,
    TYPES,
    thrust_acceleration,
    tilt_limit_rad,
)

every_type = pytest.mark.parametrize("model", TYPES.values(), ids=TYPES.keys())


def test_types_are_found_by_their_kind() -> None:
    assert TYPES["coaxial"] is COAXIAL
    assert TYPES["coaxial_lag"] is COAXIAL_LAG
    assert TYPES["quadrotor"] is QUADROTOR


@every_type
def test_hover_input_balances_gravity_within_the_limits(model: Model) -> None:
    assert np.all(model.hover_input >= model.u_min)
    assert np.all(model.hover_input <= model.u_max)
    assert np.allclose(motion_derivative(model, np.zeros(8), model.hover_input, np.zeros(4)), 0.0)
    assert model.hover_thrust == pytest.approx(model.hover_input[2], rel=0.02)


@every_type
def test_limits_are_consistent(model: Model) -> None:
    assert np.all(np.array(model.state_min) < np.array(model.state_max))
    assert np.all(model.u_min < model.u_max)
    assert np.all(model.k <= 0)
    assert np.all(model.b > 0)


@every_type
def test_full_thrust_climbs_and_no_thrust_falls(model: Model) -> None:
    assert model.b[2] * model.u_max[2] > model.gravity_m_s2
    assert model.u_min[2] == 0.0


def test_quadrotor_tilt_limit_follows_from_its_gain() -> None:
    assert tilt_limit_rad(QUADROTOR) == pytest.approx(TILT_LIMIT_RAD)
    assert tilt_limit_rad(replace(QUADROTOR, input_gain=(5.0, 5.0, 18.0, 10.0))) > TILT_LIMIT_RAD


@given(pitch=st.floats(-1.2, 1.2), roll=st.floats(-1.2, 1.2), thrust=st.floats(0, 30))
def test_tilted_thrust_keeps_its_length(pitch: float, roll: float, thrust: float) -> None:
    assert math.hypot(*thrust_acceleration(pitch, roll, thrust)) == pytest.approx(thrust, abs=1e-9)


@given(stick=st.floats(-0.3, 0.3))
def test_near_hover_the_quadrotor_accelerates_as_its_linear_model(stick: float) -> None:
    forward, _, _ = thrust_acceleration(TILT_LIMIT_RAD * stick, 0.0, QUADROTOR.gravity_m_s2)
    assert forward == pytest.approx(QUADROTOR.input_gain[0] * stick, rel=0.06, abs=1e-12)
