"""Promises of the helicopter as a plant of the laboratory."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.conditions import HELICOPTER, HELICOPTERS, IDEAL
from support.vehicle_types import COAXIAL

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.helicopter import Helicopter, Servo, helicopter_of
from rcopterx.simulator.helicopter_parameters import HelicopterParameters, Rotors
from rcopterx.simulator.plant import BodyPose, PlantFaults
from rcopterx.vehicles.state import GRAVITY_M_S2, XD_BODY, YAW_RATE, YD_BODY, ZD_BODY

CALM = replace(IDEAL, transport_delay_s=0.0, substep_s=0.004)
STRAIGHT = replace(
    HelicopterParameters.nominal(),
    trim=(0.0, 0.0, 0.0, 0.0),
    marker_roll_rad=0.0,
    marker_pitch_rad=0.0,
    phase_per_speed_s=Rotors(0.0, 0.0),
    phase_at_rest_rad=Rotors(0.0, 0.0),
)
HOVER = (0.0, 0.0, GRAVITY_M_S2 / 18.0, 0.0)


def flying(
    parameters: HelicopterParameters = STRAIGHT,
    conditions: Conditions = CALM,
    height_m: float = 50.0,
    yaw_rad: float = 0.3,
) -> Helicopter:
    return Helicopter("h1", COAXIAL, conditions, 0, BodyPose((0.0, 0.0, height_m), yaw_rad), parameters)


def test_trimmed_vehicle_hovers_with_the_identified_thrust() -> None:
    plant = flying()
    plant.set_input(HOVER)
    plant.advance(20.0)
    assert plant.motion == pytest.approx((0.0, 0.0, 50.0, 0.3, 0.0, 0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    ("sticks", "index"),
    [((0.1, 0.0, 0.545, 0.0), XD_BODY), ((0.0, 0.1, 0.545, 0.0), YD_BODY),
     ((0.0, 0.0, 0.6, 0.0), ZD_BODY), ((0.0, 0.0, 0.545, 0.1), YAW_RATE)],
)  # fmt: skip
def test_every_stick_moves_its_axis_in_the_direction_of_its_sign(
    sticks: tuple[float, ...], index: int
) -> None:
    plant = flying()
    plant.set_input(sticks)
    plant.advance(0.6)
    assert plant.motion[index] > 0.05
    others = [abs(value) for i, value in enumerate(plant.motion) if i in (XD_BODY, YD_BODY) and i != index]
    assert max(others) < 0.02


def test_more_thrust_yaws_the_vehicle_until_the_slower_rotor_has_caught_up() -> None:
    plant = flying()
    plant.set_input((0.0, 0.0, 0.6, 0.0))
    plant.advance(0.1)
    assert plant.motion[YAW_RATE] > 0.1
    plant.advance(3.0)
    assert plant.motion[YAW_RATE] == pytest.approx(0.0, abs=0.01)


@given(pitch=st.floats(0.05, 1.0))
@settings(max_examples=10, deadline=None)
def test_left_and_right_mirror_each_other(pitch: float) -> None:
    left, right = flying(yaw_rad=0.0), flying(yaw_rad=0.0)
    left.set_input((0.0, pitch, 0.55, 0.0))
    right.set_input((0.0, -pitch, 0.55, 0.0))
    for plant in (left, right):
        plant.advance(0.5)
    assert left.motion[1] == pytest.approx(-right.motion[1], abs=1e-7)
    assert left.motion[2] == pytest.approx(right.motion[2], abs=1e-7)
    assert left.pose.roll_rad == pytest.approx(-right.pose.roll_rad, abs=1e-7)


def test_forward_acceleration_is_a_nose_down_attitude() -> None:
    plant = flying()
    plant.set_input((0.5, 0.5, 0.55, 0.0))
    plant.advance(0.4)
    thrust_axis = Rotation.from_quat(plant.pose.quaternion_xyzw).apply([0.0, 0.0, 1.0])
    forward = np.array([math.cos(plant.pose.yaw_rad), math.sin(plant.pose.yaw_rad), 0.0])
    assert plant.pose.pitch_rad > 0.05
    assert plant.pose.roll_rad < -0.05
    assert thrust_axis @ forward > 0.05


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -2.5])
def test_markers_are_rotated_against_the_body_by_the_same_angle_at_any_heading(yaw_rad: float) -> None:
    crooked = replace(STRAIGHT, marker_roll_rad=-0.05, marker_pitch_rad=0.03)
    plant = flying(crooked, yaw_rad=yaw_rad)
    assert plant.marker_pose.roll_rad == pytest.approx(-0.05)
    assert plant.marker_pose.pitch_rad == pytest.approx(0.03)
    plant.set_input((0.6, -0.4, 0.6, 0.2))
    plant.advance(0.5)
    body, markers = (Rotation.from_quat(pose.quaternion_xyzw) for pose in (plant.pose, plant.marker_pose))
    expected = Rotation.from_euler("ZYX", [0.0, 0.03, -0.05])
    assert ((body.inv() * markers) * expected.inv()).magnitude() < 1e-6
    assert plant.marker_pose.position_m == plant.pose.position_m


def test_yaw_is_unwrapped() -> None:
    plant = flying()
    plant.set_input((0.0, 0.0, 0.545, 0.4))
    plant.advance(2.0)
    assert plant.pose.yaw_rad > 3 * math.pi
    assert plant.marker_pose.yaw_rad == pytest.approx(plant.pose.yaw_rad, abs=0.02)
    assert plant.motion[YAW_RATE] == pytest.approx(0.4 * 22.2, rel=0.02)


def test_a_drifting_gyro_turns_the_vehicle_at_the_rate_of_its_offset() -> None:
    conditions, rates = replace(CALM, gyro_drift_rad_s=0.05), []
    for drifting in (conditions, conditions, CALM):
        plant = flying(conditions=drifting)
        for _ in range(30):
            plant.set_input(HOVER)
            plant.advance(1.0)
            rates.append(plant.motion[YAW_RATE])
    once, again, still = np.reshape(rates, (3, 30))
    assert once.tolist() == again.tolist()
    assert 0.005 < np.abs(once).max() < 0.25
    assert once.std() > 0.002
    assert np.abs(still).max() < 1e-9


def test_servo_moves_in_steps_and_not_for_less_than_one() -> None:
    servo = Servo(0.005)
    assert [servo.move(command) for command in (0.0049, 0.0051, 0.0, 0.0099, 0.0126, 0.0)] == pytest.approx(
        [0.0, 0.005, 0.005, 0.005, 0.015, 0.0]
    )
    assert Servo(0.0).move(0.0001) == 0.0001


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=50))
def test_servo_stays_within_one_step_of_its_command_and_on_its_grid(commands: list[float]) -> None:
    servo = Servo(0.005)
    for command in commands:
        position = servo.move(command)
        assert abs(position - command) <= 0.005 * (1 + 1e-6)
        assert position / 0.005 == pytest.approx(round(position / 0.005), abs=1e-6)


def test_standing_vehicle_spins_up_before_it_leaves_the_floor_level() -> None:
    plant = flying(height_m=0.0)
    assert plant.on_floor
    assert not plant.motors_running
    plant.set_input((0.0, 0.0, 0.4, 0.3))
    plant.advance(2.0)
    assert plant.on_floor
    assert plant.state.speed_upper > 200.0, "the rotor turns"
    assert plant.motion == (0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0)
    plant.set_input((0.3, 0.0, 0.6, 0.0))
    plant.advance(0.02)
    assert plant.on_floor, "the rotors need time"
    plant.advance(1.0)
    assert not plant.on_floor
    assert plant.pose.position_m[2] > 0.1


def test_ground_effect_lets_it_leave_the_floor_with_less_than_hover_thrust() -> None:
    with_effect, without = (
        flying(replace(STRAIGHT, ground_effect=effect), height_m=0.0) for effect in (0.1, 0.0)
    )
    for plant in (with_effect, without):
        plant.set_input((0.0, 0.0, 0.95 * HOVER[2], 0.0))
        plant.advance(3.0)
    assert without.on_floor
    assert 0.0 < with_effect.pose.position_m[2] < 0.3


def test_tilted_touchdown_levels_the_vehicle_and_reports_its_speed() -> None:
    plant = flying(height_m=0.4)
    plant.set_input((1.0, 0.0, 0.45, 0.0))
    plant.advance(0.4)
    assert plant.pose.pitch_rad > 0.1
    plant.stop_motors()
    plant.advance(2.0)
    assert plant.on_floor
    assert plant.touchdowns == 1
    assert plant.touchdown_speed_m_s is not None
    assert 0.5 < plant.touchdown_speed_m_s < math.sqrt(2 * 9.81 * 0.4) + 0.1
    assert plant.pose.pitch_rad == plant.pose.roll_rad == plant.pose.position_m[2] == 0.0
    assert plant.motion[4:] == (0.0, 0.0, 0.0, 0.0)


def test_battery_takes_thrust_through_the_rotors() -> None:
    plant = flying(conditions=replace(CALM, battery_sag=0.15, battery_endurance_s=10.0))
    plant.set_input(HOVER)
    plant.advance(12.0)
    assert plant.thrust_factor == pytest.approx(0.85)
    before = plant.motion[ZD_BODY]
    plant.advance(0.5)
    assert (plant.motion[ZD_BODY] - before) / 0.5 == pytest.approx(-0.15 * 9.81, rel=0.03)


def test_inputs_take_effect_after_the_transport_delay() -> None:
    plant = flying(conditions=replace(CALM, transport_delay_s=0.1))
    plant.set_input((1.0, 0.0, HOVER[2], 0.0))
    plant.advance(0.1)
    assert plant.motion[XD_BODY] == pytest.approx(0.0, abs=1e-9)
    plant.advance(0.05)
    assert plant.motion[XD_BODY] > 1e-3


@pytest.mark.parametrize(
    ("faults", "reaction"),
    [
        (PlantFaults(), 1.0),
        (PlantFaults(stick_gain=(-1.0, 1.0, 1.0, 1.0)), -1.0),
        (PlantFaults(stick_gain=(0.0, 1.0, 1.0, 1.0)), 0.0),
        (PlantFaults(stuck=frozenset({0})), 0.0),
        (PlantFaults(trim=(-0.4, 0.0, 0.0, 0.0)), 0.0),
    ],
)
def test_faults_of_a_stick_change_what_it_does(faults: PlantFaults, reaction: float) -> None:
    sound, broken = flying(), flying()
    broken.faults = faults
    for plant in (sound, broken):
        plant.set_input((0.4, 0.0, HOVER[2], 0.0))
        plant.advance(0.5)
    assert broken.motion[XD_BODY] == pytest.approx(reaction * sound.motion[XD_BODY], abs=1e-7)


def test_vehicle_without_lift_falls() -> None:
    plant = flying(height_m=2.0)
    plant.faults = PlantFaults(thrust_factor=0.0)
    plant.set_input(HOVER)
    plant.advance(2.0)
    assert plant.on_floor


def test_family_is_reproducible_by_seed_and_name_and_the_middle_is_not_drawn() -> None:
    drawn = helicopter_of("h1", HELICOPTERS, 3)
    assert helicopter_of("h1", HELICOPTERS, 3) == drawn
    assert helicopter_of("h2", HELICOPTERS, 3) != drawn
    assert helicopter_of("h1", HELICOPTERS, 4) != drawn
    assert helicopter_of("h1", HELICOPTER, 3) == helicopter_of("h2", HELICOPTER, 4)


@given(cuts=st.lists(st.floats(0.0, 0.02), max_size=10), pitch=st.floats(-1, 1))
@settings(max_examples=15, deadline=None)
def test_flight_does_not_depend_on_how_time_is_cut(cuts: list[float], pitch: float) -> None:
    whole, sliced = flying(conditions=HELICOPTER), flying(conditions=HELICOPTER)
    for plant in (whole, sliced):
        plant.set_input((pitch, 0.0, 0.55, 0.0))
    for cut in cuts:
        sliced.advance(cut)
    sliced.advance(0.3 - sum(cuts))
    whole.advance(0.3)
    assert whole.motion == pytest.approx(sliced.motion, abs=1e-3)


@given(
    seed=st.integers(0, 10**6),
    commands=st.lists(
        st.one_of(
            st.none(),
            st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 1), st.floats(-1, 1)),
        ),
        min_size=1,
        max_size=12,
    ),
)
@settings(max_examples=20, deadline=None)
def test_flight_stays_finite_and_above_the_floor(seed: int, commands: list[tuple[float, ...] | None]) -> None:
    plant = flying(helicopter_of("h1", HELICOPTERS, seed), HELICOPTERS, height_m=0.3)
    for command in commands:
        if command is None:
            plant.stop_motors()
        else:
            plant.set_input(command)
        plant.advance(0.2)
        marker = plant.marker_pose
        assert np.all(np.isfinite([*plant.motion, marker.yaw_rad, marker.pitch_rad, marker.roll_rad]))
        assert plant.motion[2] > -1e-3


def test_one_vehicle_costs_at_most_four_percent_of_a_core_in_real_time() -> None:
    plant = flying(helicopter_of("h1", HELICOPTERS, 1), HELICOPTERS)
    plant.set_input((0.1, 0.1, 0.55, 0.0))
    started_s = time.process_time()
    plant.advance(10.0)
    assert (time.process_time() - started_s) / 10.0 < 0.04
