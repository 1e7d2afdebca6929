"""The kernels that fly simulated helicopters do, bit for bit, what plain Python would do step by step."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.native.helicopter import turned
from rcopterx.simulator.conditions import HELICOPTER, Conditions
from rcopterx.simulator.disturbance import TURBULENCE, ColouredNoise, NormalSource, random_stream
from rcopterx.simulator.helicopter import Helicopter
from rcopterx.simulator.helicopter_parameters import HelicopterParameters
from rcopterx.simulator.plant import PlantFaults, Pose
from rcopterx.vehicles.state import U_THRUST
from rcopterx.vehicles.types import COAXIAL

WINDY = replace(HELICOPTER, transport_delay_s=0.0, battery_endurance_s=2.0, battery_sag=0.3)
STICKS = (0.3, -0.2, 0.55, 0.4)


class StepByStep:
    """A helicopter in flight from the same start, each step in Python."""

    def __init__(self, plant: Helicopter, conditions: Conditions, seed: int) -> None:
        self.plant, self.conditions = plant, conditions
        self.state, self.yaw_rad, self.used_s = plant.state, plant.pose.yaw_rad, 0.0
        self.time_s, self.index, self.outside, self.landed = 0.0, 0, False, False
        self.normal = NormalSource(random_stream(seed, "h1", TURBULENCE))
        keep = math.exp(-conditions.substep_s / conditions.turbulence_correlation_s)
        renew = math.sqrt(-math.expm1(-2 * conditions.substep_s / conditions.turbulence_correlation_s))
        self.keep, self.renewal = keep, [renew * channel for channel in conditions.turbulence_rms]
        self.value = [channel * self.normal() for channel in conditions.turbulence_rms]

    def step(self, step_s: float) -> None:
        plant, conditions = self.plant, self.conditions
        self.used_s += step_s * STICKS[U_THRUST] / COAXIAL.hover_input[U_THRUST]
        left = 1.0 - conditions.battery_sag * min(self.used_s / conditions.battery_endurance_s, 1.0)
        while self.index < int((self.time_s + step_s / 2) / conditions.substep_s):
            self.index += 1
            self.value = [
                self.keep * value + renewal * self.normal()
                for value, renewal in zip(self.value, self.renewal, strict=True)
            ]
        x, y, z, yaw = self.value
        self.state = plant._dynamics.step(
            self.state, step_s, plant._swash, plant._throttle, left * plant.faults.thrust_factor,
            (x, y, z - plant.downwash_m_s2, yaw),
        )  # fmt: skip
        w, i, j, k = self.state[6:10]
        angle = math.atan2(2 * (i * j + w * k), 1 - 2 * (j * j + k * k))
        self.yaw_rad += math.remainder(angle - self.yaw_rad, math.tau)
        self.landed = self.state[2] <= 0.0 and self.state[5] < 0.0
        places = zip(conditions.volume_min_m, self.state[:3], conditions.volume_max_m, strict=True)
        self.outside = self.outside or not all(low <= place <= high for low, place, high in places)
        self.time_s += step_s


@pytest.mark.parametrize("rms", [(0.0, 0.0, 0.0, 0.0), HELICOPTER.turbulence_rms])
@given(seed=st.integers(0, 1000), height_m=st.sampled_from((0.02, 1.0)), thrust=st.sampled_from((0.4, 1.0)))
def test_flight_is_that_of_single_steps(
    rms: tuple[float, float, float, float], seed: int, height_m: float, thrust: float
) -> None:
    conditions = replace(WINDY, turbulence_rms=rms, volume_min_m=(-0.01, -0.01, 0.0))
    start = Pose((0.0, 0.0, height_m), 3.1)
    plant = Helicopter("h1", COAXIAL, conditions, seed, start, HelicopterParameters.nominal())
    plant.downwash_m_s2, plant.faults = 0.3, PlantFaults(thrust_factor=thrust)
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
            assert plant.touchdown_speed_m_s == -plain.state[5]
            return
        assert plant.state == plain.state
        assert plant.pose.yaw_rad == pytest.approx(plain.yaw_rad, abs=1e-15)
        assert plant.thrust_factor == 1.0 - 0.3 * min(plain.used_s / 2.0, 1.0)
        assert plant.turbulence == (tuple(plain.value) if any(rms) else rms)


@given(st.floats(-100.0, 100.0), st.floats(-math.pi, math.pi))
def test_headings_turn_by_the_remainder_of_the_standard(yaw_rad: float, angle: float) -> None:
    w, z = math.cos(angle / 2), math.sin(angle / 2)
    found = math.atan2(2 * (0.0 * 0.0 + w * z), 1 - 2 * (0.0 * 0.0 + z * z))
    assert turned(yaw_rad, w, 0.0, 0.0, z) == math.remainder(found - yaw_rad, math.tau)


@given(
    seed=st.integers(0, 1000),
    channels=st.integers(1, 5),
    pauses=st.lists(st.sampled_from((0.001, 0.01, 1.7)), min_size=1, max_size=20),
)
def test_turbulence_moves_on_by_one_number_for_each_channel_and_step(
    seed: int, channels: int, pauses: list[float]
) -> None:
    rms = (0.1, 0.2, 0.3, 0.4, 0.5)[:channels]
    noise = ColouredNoise(rms, 0.5, 0.004, random_stream(seed, "h1", TURBULENCE))
    normal = NormalSource(random_stream(seed, "h1", TURBULENCE))
    value, index = [channel * normal() for channel in rms], 0
    keep, renew = math.exp(-0.004 / 0.5), math.sqrt(-math.expm1(-2 * 0.004 / 0.5))
    for time_s in np.cumsum(pauses).tolist():
        while index < int(time_s / 0.004):
            value = [keep * old + renew * sigma * normal() for old, sigma in zip(value, rms, strict=True)]
            index += 1
        assert noise.at(time_s) == tuple(value)
