"""Promises of the simulated vehicle."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support.conditions import IDEAL, LABORATORY
from support.equation_one import motion_derivative
from support.vehicle_types import COAXIAL_LAG, QUADROTOR

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.first_order_plant import FirstOrderPlant
from rcopterx.simulator.plant import BodyPose, PlantFaults
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import ZD_BODY, Array

HOVER = tuple(COAXIAL_LAG.hover_input)
PROMPT = replace(IDEAL, transport_delay_s=0.0)
sticks = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.3, 0.8), st.floats(-0.4, 0.4))


def flying(
    model: Model = COAXIAL_LAG, conditions: Conditions = PROMPT, height_m: float = 1.0
) -> FirstOrderPlant:
    return FirstOrderPlant("h1", model, conditions, 0, BodyPose((0.0, 0.0, height_m), 0.3))


def standing(conditions: Conditions = PROMPT) -> FirstOrderPlant:
    return FirstOrderPlant("h1", COAXIAL_LAG, conditions, 0, BodyPose((0.0, 0.0, 0.0), 0.3))


def fine_integration(model: Model, start: Array, actuator: Array, target: Array, duration_s: float) -> Array:
    def derivative(_: float, state: Array) -> Array:
        lagged = (target - state[8:]) / np.array(model.lag_s)
        return np.concatenate([motion_derivative(model, state[:8], state[8:], np.zeros(4)), lagged])

    start = np.concatenate([start, actuator])
    solution = solve_ivp(derivative, (0, duration_s), start, method="DOP853", rtol=1e-10, atol=1e-12)
    return np.asarray(solution.y[:8, -1])


@settings(max_examples=25, deadline=None)
@given(inputs=sticks)
def test_flight_agrees_with_fine_integration_of_equation_1(inputs: tuple[float, ...]) -> None:
    plant = flying(height_m=50.0)
    start = np.array(plant.motion)
    plant.set_input(inputs)
    plant.advance(0.5)
    expected = fine_integration(COAXIAL_LAG, start, np.array(HOVER), np.array(inputs), 0.5)
    assert np.allclose(plant.motion, expected, atol=2e-4)


@settings(max_examples=25, deadline=None)
@given(inputs=sticks, cuts=st.lists(st.floats(0.0, 0.02), max_size=10))
def test_flight_does_not_depend_on_how_time_is_cut(inputs: tuple[float, ...], cuts: list[float]) -> None:
    whole, sliced = flying(conditions=replace(LABORATORY)), flying(conditions=replace(LABORATORY))
    for plant in (whole, sliced):
        plant.set_input(inputs)
    for cut in cuts:
        sliced.advance(cut)
    sliced.advance(0.3 - sum(cuts))
    whole.advance(0.3)
    assert np.allclose(whole.motion, sliced.motion, atol=1e-3)


def test_hover_input_keeps_an_ideal_vehicle_at_rest() -> None:
    for model in (COAXIAL_LAG, QUADROTOR):
        plant = flying(model)
        plant.set_input(model.hover_input)
        plant.advance(10.0)
        assert np.allclose(plant.motion, (0, 0, 1.0, 0.3, 0, 0, 0, 0), atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(inputs=sticks)
def test_damping_takes_kinetic_energy_out_of_horizontal_flight(inputs: tuple[float, ...]) -> None:
    plant = flying(height_m=50.0)
    plant.set_input(inputs)
    plant.advance(1.0)
    plant.set_input((0.0, 0.0, HOVER[2], 0.0))
    plant.advance(0.5)
    energies = []
    for _ in range(20):
        plant.advance(0.1)
        energies.append(plant.motion[4] ** 2 + plant.motion[5] ** 2)
    assert all(later <= earlier + 1e-7 for earlier, later in pairwise(energies))


def test_inputs_take_effect_after_the_transport_delay() -> None:
    plant = flying(conditions=replace(IDEAL, transport_delay_s=0.05))
    plant.set_input((1.0, 0.0, HOVER[2], 0.0))
    plant.advance(0.05)
    assert plant.motion[4] == 0.0
    plant.advance(0.002)
    assert plant.motion[4] > 0.0


def test_inputs_of_a_vehicle_whose_sticks_act_late_take_effect_later_and_in_order() -> None:
    plant = flying(conditions=replace(IDEAL, transport_delay_s=0.05))
    plant.faults = PlantFaults(delay_s=0.1)
    plant.set_input((1.0, 0.0, HOVER[2], 0.0))
    plant.faults = PlantFaults()
    plant.set_input(HOVER)
    plant.advance(0.149)
    assert plant.motion[4] == 0.0
    plant.advance(0.101)
    assert plant.motion[4] == 0.0


def test_without_a_stated_delay_the_delay_of_the_model_acts() -> None:
    plant = FirstOrderPlant("h1", replace(COAXIAL_LAG, delay_s=0.03), IDEAL, 0, BodyPose((0.0, 0.0, 1.0)))
    plant.set_input((1.0, 0.0, HOVER[2], 0.0))
    plant.advance(0.03)
    assert plant.motion[4] == 0.0
    plant.advance(0.01)
    assert plant.motion[4] > 0.0


@settings(max_examples=25, deadline=None)
@given(inputs=sticks, after_s=st.floats(0.0, 0.02))
def test_sticks_moved_later_act_as_if_they_were_moved_then(inputs: tuple[float, ...], after_s: float) -> None:
    commanded, waited = flying(height_m=50.0), flying(height_m=50.0)
    commanded.set_input(inputs, after_s)
    commanded.advance(0.04)
    waited.advance(after_s)
    waited.set_input(inputs)
    waited.advance(0.04 - after_s)
    assert commanded.motion == pytest.approx(waited.motion, abs=1e-5)


def test_motors_stop_and_start_when_they_are_told_to() -> None:
    plant = flying(height_m=50.0)
    plant.stop_motors(0.01)
    plant.set_input(HOVER, 0.02)
    plant.advance(0.005)
    assert plant.motors_running
    plant.advance(0.01)
    assert not plant.motors_running
    plant.advance(0.01)
    assert plant.motors_running


@pytest.mark.parametrize("after_s", [-0.001, math.nan, math.inf])
def test_sticks_cannot_be_moved_in_the_past_or_never(after_s: float) -> None:
    plant = flying()
    with pytest.raises(ValueError, match="cannot be commanded after"):
        plant.set_input(HOVER, after_s)
    with pytest.raises(ValueError, match="cannot be commanded after"):
        plant.stop_motors(after_s)


def test_actuator_lag_can_be_switched_off() -> None:
    lagging, prompt = flying(), flying(conditions=replace(PROMPT, actuator_lag=False))
    for plant in (lagging, prompt):
        plant.set_input((1.0, 0.0, HOVER[2], 0.0))
        plant.advance(0.02)
    assert math.isclose(prompt.motion[4], 2.0 * 0.02, rel_tol=0.02)
    assert lagging.motion[4] < 0.3 * prompt.motion[4]


def test_standing_vehicle_stays_until_thrust_exceeds_weight() -> None:
    plant = standing(replace(LABORATORY, trim_offset=0.0, parameter_mismatch=0.0))
    plant.advance(1.0)
    plant.set_input((1.0, 1.0, HOVER[2] - 0.01, 0.4))
    plant.advance(1.0)
    assert plant.on_floor
    assert plant.motion == (0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0)
    plant.set_input((0.0, 0.0, HOVER[2] + 0.05, 0.0))
    plant.advance(1.0)
    assert not plant.on_floor
    assert plant.pose.position_m[2] > 0.1


def test_falling_vehicle_lands_and_reports_the_touchdown_speed() -> None:
    plant = flying(conditions=replace(PROMPT, actuator_lag=False), height_m=0.5)
    plant.stop_motors()
    plant.advance(2.0)
    assert not plant.motors_running
    assert plant.on_floor
    assert plant.touchdowns == 1
    assert plant.touchdown_speed_m_s == pytest.approx(math.sqrt(2 * 9.81 * 0.5), abs=0.03)
    assert plant.motion[4:] == (0.0, 0.0, 0.0, 0.0)


def test_stopped_motors_run_again_with_the_next_input() -> None:
    plant = standing()
    assert not plant.motors_running
    plant.set_input((0.0, 0.0, 0.7, 0.0))
    plant.advance(0.5)
    assert plant.motors_running
    assert not plant.on_floor


def test_battery_sag_takes_thrust_over_time() -> None:
    fresh = flying(conditions=replace(PROMPT, battery_sag=0.2, battery_endurance_s=10.0), height_m=5.0)
    fresh.set_input(HOVER)
    fresh.advance(0.5)
    assert fresh.thrust_factor == pytest.approx(1 - 0.2 * 0.05, abs=1e-3)
    assert fresh.motion[ZD_BODY] < 0.0
    fresh.advance(20.0)
    assert fresh.thrust_factor == pytest.approx(0.8)


def test_a_battery_charges_while_its_vehicle_stands_with_its_motors_off_and_not_beyond_full() -> None:
    conditions = replace(PROMPT, battery_endurance_s=10.0, charging_s=40.0)
    plant = FirstOrderPlant("h1", COAXIAL_LAG, conditions, 0, BodyPose((0.0, 0.0, 0.0)))
    plant.set_input((0.0, 0.0, 0.5 * HOVER[2], 0.0))
    plant.advance(10.0)
    assert plant.on_floor
    assert plant.used == pytest.approx(0.5, abs=0.01), "half the thrust of a hover"
    plant.stop_motors()
    plant.advance(10.0)
    assert plant.used == pytest.approx(0.25, abs=0.01)
    plant.advance(60.0)
    assert plant.used == 0.0
    plant.set_input(HOVER)
    plant.advance(2.0)
    plant.renew_battery()
    assert plant.used == 0.0


def test_parameters_are_drawn_within_the_stated_fractions() -> None:
    draws = []
    for seed in range(30):
        plant = FirstOrderPlant("h1", COAXIAL_LAG, LABORATORY, seed, BodyPose((0.0, 0.0, 1.0)))
        draws.append(plant.model.b / COAXIAL_LAG.b - 1)
        assert np.all(np.abs(draws[-1]) <= 0.08)
        assert np.all(np.abs(plant.model.k - COAXIAL_LAG.k) <= 0.08 * np.abs(COAXIAL_LAG.k))
        assert np.all(np.abs(np.divide(plant.model.lag_s, COAXIAL_LAG.lag_s) - 1) <= 0.25)
        assert np.all(np.abs(plant.trim) <= 0.02)
    assert np.all(np.ptp(draws, axis=0) > 0.1)


def test_ideal_specimen_is_the_model() -> None:
    plant = flying()
    assert plant.model == COAXIAL_LAG
    assert plant.trim == (0.0, 0.0, 0.0, 0.0)


def test_same_seed_repeats_the_flight_exactly_and_another_does_not() -> None:
    def flight(seed: int) -> tuple[float, ...]:
        plant = FirstOrderPlant("h1", COAXIAL_LAG, LABORATORY, seed, BodyPose((0.0, 0.0, 1.0)))
        plant.advance(1.0)
        return plant.motion

    assert flight(3) == flight(3)
    assert flight(3) != flight(4)


def test_leaving_the_flight_volume_is_flagged_and_remembered() -> None:
    plant = flying(conditions=replace(PROMPT, volume_max_m=(2.0, 2.0, 1.1)))
    plant.set_input((0.0, 0.0, 0.7, 0.0))
    plant.advance(0.1)
    assert not plant.left_volume
    plant.advance(1.0)
    plant.stop_motors()
    plant.advance(5.0)
    assert plant.on_floor
    assert plant.left_volume


def test_quadrotor_tilts_into_its_acceleration_and_loses_lift() -> None:
    plant = flying(QUADROTOR)
    plant.set_input((1.0, 0.0, QUADROTOR.hover_input[2], 0.0))
    plant.advance(0.3)
    assert plant.pose.pitch_rad > 0.2
    assert plant.motion[4] > 0.0
    assert plant.motion[ZD_BODY] < 0.0
    thrust_axis = Rotation.from_quat(plant.pose.quaternion_xyzw).apply([0.0, 0.0, 1.0])
    heading = np.array([math.cos(plant.pose.yaw_rad), math.sin(plant.pose.yaw_rad), 0.0])
    assert thrust_axis @ heading == pytest.approx(math.sin(plant.pose.pitch_rad))


def test_quadrotor_accelerates_to_the_left_by_the_roll_stick() -> None:
    plant = flying(QUADROTOR)
    plant.set_input((0.0, 1.0, QUADROTOR.hover_input[2], 0.0))
    plant.advance(0.3)
    assert plant.motion[5] > 0.0
    assert plant.pose.roll_rad < -0.2


@given(yaw=st.floats(-10, 10), pitch=st.floats(-1, 1), roll=st.floats(-1, 1))
def test_quaternion_is_the_rotation_by_yaw_pitch_roll(yaw: float, pitch: float, roll: float) -> None:
    quaternion = BodyPose((0.0, 0.0, 0.0), yaw, pitch, roll).quaternion_xyzw
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    assert (Rotation.from_quat(quaternion) * expected.inv()).magnitude() < 1e-7


@settings(max_examples=20, deadline=None)
@given(commands=st.lists(st.one_of(sticks, st.none()), min_size=1, max_size=20), seed=st.integers(0, 99))
def test_flight_stays_finite_and_above_the_floor(commands: list[tuple[float, ...] | None], seed: int) -> None:
    plant = FirstOrderPlant("h1", COAXIAL_LAG, LABORATORY, seed, BodyPose((0.0, 0.0, 0.2)))
    for command in commands:
        if command is None:
            plant.stop_motors()
        else:
            plant.set_input(command)
        plant.advance(0.1)
        assert np.all(np.isfinite(plant.motion))
        assert plant.motion[2] >= 0.0 or not plant.on_floor
        assert plant.motion[2] > -1e-3


def test_unusable_requests_are_refused() -> None:
    plant = flying()
    with pytest.raises(ValueError, match="h1: input"):
        plant.set_input((0.0, math.nan, 0.5, 0.0))
    with pytest.raises(ValueError, match="3 inputs given, a vehicle has 4"):
        plant.set_input((0.0, 0.0, 0.5))
    with pytest.raises(ValueError, match="h1: cannot advance by -1"):
        plant.advance(-1.0)
    with pytest.raises(ValueError, match="h1: cannot be placed at"):
        plant.place(BodyPose((0.0, 0.0, -0.1)))
