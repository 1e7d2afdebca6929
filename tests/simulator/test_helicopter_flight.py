"""The kernel that flies simulated helicopters does what Python does step by step."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.conditions import HELICOPTER
from support.vehicle_types import COAXIAL

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.disturbance import TURBULENCE, ColouredNoise, random_stream
from rcopterx.simulator.helicopter import Helicopter
from rcopterx.simulator.helicopter_dynamics import Controls, airframe_of, step, swash_target
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.simulator.plant import BodyPose, PlantFaults, Wake
from rcopterx.vehicles.state import U_THRUST

WINDY = replace(
    HELICOPTER, transport_delay_s=0.0, radio_period_s=0.0, battery_endurance_s=2.0, battery_sag=0.3
)
VEHICLE = replace(HelicopterParameters.nominal(), servo_step=0.0, trim=(0.0, 0.0, 0.0, 0.0))
STICKS = (0.3, -0.2, 0.55, 0.4)


class StepByStep:
    """A helicopter in flight from the same start, each step in Python."""

    def __init__(self, plant: Helicopter, conditions: Conditions, seed: int) -> None:
        self.plant, self.conditions = plant, conditions
        self.state, self.yaw_rad, self.used_s = plant.state, plant.pose.yaw_rad, 0.0
        self.time_s, self.outside, self.landed = 0.0, False, False
        self.noise = ColouredNoise(
            conditions.turbulence_rms,
            conditions.turbulence_correlation_s,
            conditions.substep_s,
            random_stream(seed, "h1", TURBULENCE),
        )
        pitch, roll, thrust, yaw = STICKS
        self.airframe = airframe_of(plant.parameters)
        self.controls = Controls(*swash_target(plant.parameters, pitch, roll), True, thrust, yaw)

    def step(self, step_s: float) -> None:
        plant, conditions = self.plant, self.conditions
        self.used_s += step_s * STICKS[U_THRUST] / COAXIAL.hover_input[U_THRUST]
        left = 1.0 - conditions.battery_sag * min(self.used_s / conditions.battery_endurance_s, 1.0)
        x, y, z, yaw = self.noise.at(self.time_s + step_s / 2)
        air = (x, y, z - plant.wake.down_m_s2, yaw, 0.0, 0.0)
        state = step(self.airframe, self.state, self.controls, left * plant.faults.thrust_factor, air, step_s)
        self.state = state
        w, i, j, k = state.qw, state.qx, state.qy, state.qz
        angle = math.atan2(2 * (i * j + w * k), 1 - 2 * (j * j + k * k))
        self.yaw_rad += math.remainder(angle - self.yaw_rad, math.tau)
        self.landed = state.z <= 0.0 and state.vz < 0.0
        places = zip(conditions.volume_min_m, state[:3], conditions.volume_max_m, strict=True)
        self.outside = self.outside or not all(low <= place <= high for low, place, high in places)
        self.time_s += step_s


@pytest.mark.parametrize("rms", [(0.0, 0.0, 0.0, 0.0), HELICOPTER.turbulence_rms])
@given(seed=st.integers(0, 1000), height_m=st.sampled_from((0.02, 1.0)), thrust=st.sampled_from((0.4, 1.0)))
def test_flight_is_that_of_single_steps(
    rms: tuple[float, float, float, float], seed: int, height_m: float, thrust: float
) -> None:
    conditions = replace(WINDY, turbulence_rms=rms, volume_min_m=(-0.01, -0.01, 0.0))
    plant = Helicopter("h1", COAXIAL, conditions, seed, BodyPose((0.0, 0.0, height_m), 3.1), VEHICLE)
    plant.wake, plant.faults = Wake(0.3), PlantFaults(thrust_factor=thrust)
    plain = StepByStep(plant, conditions, seed)
    plant.set_input(STICKS)
    for count in (1, 7, 90):
        plant.advance(count * 0.004)
        for _ in range(0 if plain.landed else count):
            plain.step(0.004)
            if plain.landed:
                break
        assert plant.left_volume == plain.outside
        assert plant.on_floor == plain.landed
        if plain.landed:
            assert plant.touchdown_speed_m_s == pytest.approx(-plain.state.vz)
            return
        assert plant.state == pytest.approx(plain.state, rel=1e-12, abs=1e-12)
        assert plant.pose.yaw_rad == pytest.approx(plain.yaw_rad, abs=1e-12)
        assert plant.thrust_factor == pytest.approx(1.0 - 0.3 * min(plain.used_s / 2.0, 1.0))
        assert plant.turbulence == pytest.approx(plain.noise.at(plain.time_s + 1e-6))


@given(yaw_rad=st.floats(-100.0, 100.0), yaw_stick=st.floats(-1.0, 1.0))
def test_heading_is_unwrapped_over_any_number_of_turns(yaw_rad: float, yaw_stick: float) -> None:
    conditions = replace(WINDY, turbulence_rms=(0.0, 0.0, 0.0, 0.0))
    plant = Helicopter("h1", COAXIAL, conditions, 0, BodyPose((0.0, 0.0, 9.0), yaw_rad), VEHICLE)
    plant.set_input((0.0, 0.0, 0.545, yaw_stick))
    turned_rad = []
    for _ in range(100):
        before_rad = plant.pose.yaw_rad
        plant.advance(0.01)
        turned_rad.append(plant.pose.yaw_rad - before_rad)
    assert np.abs(turned_rad).max() < 0.25
    other = Helicopter("h1", COAXIAL, conditions, 0, BodyPose((0.0, 0.0, 9.0), 0.0), VEHICLE)
    other.set_input((0.0, 0.0, 0.545, yaw_stick))
    other.advance(1.0)
    assert plant.pose.yaw_rad - yaw_rad == pytest.approx(other.pose.yaw_rad, abs=1e-2)
