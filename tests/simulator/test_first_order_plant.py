"""Promises of the geometry of a tilted thrust."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st
from support.conditions import IDEAL
from support.vehicle_types import QUADROTOR

from rcopterx.simulator.first_order_plant import FirstOrderPlant, thrust_acceleration, tilt_limit_rad
from rcopterx.simulator.plant import BodyPose, PlantFaults

TILT_LIMIT_RAD = math.atan(6.46 / 9.81)


def test_quadrotor_tilt_limit_follows_from_its_gain() -> None:
    assert tilt_limit_rad(QUADROTOR) == pytest.approx(TILT_LIMIT_RAD)
    assert tilt_limit_rad(replace(QUADROTOR, input_gain=(8.0, 8.0, 18.0, 10.0))) > TILT_LIMIT_RAD


@given(pitch=st.floats(-1.2, 1.2), roll=st.floats(-1.2, 1.2), thrust=st.floats(0, 30))
def test_tilted_thrust_keeps_its_length(pitch: float, roll: float, thrust: float) -> None:
    assert math.hypot(*thrust_acceleration(pitch, roll, thrust)) == pytest.approx(thrust, abs=1e-9)


@given(stick=st.floats(-0.3, 0.3))
def test_near_hover_the_quadrotor_accelerates_as_its_linear_model(stick: float) -> None:
    forward, _, _ = thrust_acceleration(TILT_LIMIT_RAD * stick, 0.0, QUADROTOR.gravity_m_s2)
    assert forward == pytest.approx(QUADROTOR.input_gain[0] * stick, rel=0.15, abs=1e-12)


@pytest.mark.parametrize("torque", [1.0, 0.5, 1.5])
def test_the_tilt_of_a_quadrotor_follows_its_stick_as_its_model_and_the_torque_of_its_loop_say(
    torque: float,
) -> None:
    tilt = QUADROTOR.tilt
    assert tilt is not None
    calm = replace(IDEAL, actuator_lag=True, transport_delay_s=0.0)
    plant = FirstOrderPlant("q1", QUADROTOR, calm, 0, BodyPose((0.0, 0.0, 1.0)))
    plant.faults = PlantFaults(attitude_gain=torque)
    plant.set_input((0.5, 0.0, float(QUADROTOR.hover_input[2]), 0.0))
    w, z, lag_s, step_s = tilt.frequency_rad_s, tilt.damping_ratio, tilt.servo_lag_s, 0.02
    continuous = np.array(
        [[0.0, 1.0, 0.0], torque * np.array([-(w**2), -2 * z * w, w**2]), [0.0, 0.0, -1 / lag_s]]
    )
    after = scipy.linalg.expm(
        step_s * np.block([[continuous, np.array([[0.0], [0.0], [1 / lag_s]])], [np.zeros(4)]])
    )
    state = np.array([0.0, 0.0, 0.0, 0.5])
    for _ in range(40):
        plant.advance(step_s)
        state = after @ state
        assert plant.pose.pitch_rad == pytest.approx(TILT_LIMIT_RAD * state[0], abs=0.01)
    assert plant.pose.pitch_rad == pytest.approx(0.5 * TILT_LIMIT_RAD, rel=0.02)
