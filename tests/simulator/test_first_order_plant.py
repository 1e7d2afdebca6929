"""Promises of the geometry of a tilted thrust."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.vehicle_types import QUADROTOR

from rcopterx.simulator.first_order_plant import thrust_acceleration, tilt_limit_rad

TILT_LIMIT_RAD = 0.35


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
