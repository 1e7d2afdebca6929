"""Promises of the Crazyflies of `drone-models` as plants."""

import math
import os
from dataclasses import replace

os.environ.setdefault("SCIPY_ARRAY_API", "1")  # the package refuses to be imported after scipy without it

import numpy as np
import pytest
from drone_models.core import parametrize
from drone_models.so_rpy_rotor_drag import dynamics
from scipy.spatial.transform import Rotation
from support.conditions import CRAZYFLIES, IDEAL
from support.vehicle_types import CRAZYFLIE

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose, PlantFaults, added_plant
from rcopterx.vehicles.state import Array
from rcopterx.vehicles.tuples import Four
from rcopterx_studies.experiments.knowledge import exact_crazyflie
from rcopterx_studies.plants.identified_crazyflie import (
    IDENTIFIED,
    CrazyfliePlant,
    IdentifiedCrazyflie,
    crazyflie_of,
)

PROMPT = replace(IDEAL, transport_delay_s=0.0)
DRONE = IdentifiedCrazyflie("cf2x_L250")
HOVER = exact_crazyflie(DRONE).hover_thrust
CIRCLE = 0.2, -0.1, HOVER + 0.05, 0.3


def flying(
    drone: IdentifiedCrazyflie = DRONE, yaw_rad: float = 0.0, conditions: Conditions = PROMPT
) -> CrazyfliePlant:
    """Vehicle at rest in the air, with motors that hold it."""
    plant = CrazyfliePlant(
        "h1", exact_crazyflie(drone), conditions, 0, BodyPose((0.0, 0.0, 9.0), yaw_rad), drone
    )
    plant.set_input((0.0, 0.0, exact_crazyflie(drone).hover_thrust, 0.0))
    return plant


def flown_by_the_package(command: Array, duration_s: float, step_s: float = 1e-3) -> Array:
    """Position and velocity as the numpy function of the package has them, which starts as `flying`."""
    model = parametrize(dynamics, DRONE.drone)
    hover_n = 9.81 * DRONE.parameters()["mass"] / DRONE.parameters()["cmd_f_coef"]
    position, velocity, rates, thrust = (
        np.array([0.0, 0.0, 9.0]),
        np.zeros(3),
        np.zeros(3),
        np.array([hover_n]),
    )
    attitude = Rotation.identity()
    for _ in range(round(duration_s / step_s)):
        change = model(position, attitude.as_quat(), velocity, rates, command, thrust)
        attitude = attitude * Rotation.from_rotvec((rates + step_s / 2 * change[3]) * step_s)
        position = position + step_s * (velocity + step_s / 2 * change[2])
        velocity, rates, thrust = (
            value + step_s * rate for value, rate in zip((velocity, rates, thrust), change[2:], strict=True)
        )
    return np.concatenate((position, velocity))


def test_flight_is_that_of_the_numpy_function_of_the_package() -> None:
    plant = flying()
    plant.set_input((0.3, -0.2, HOVER + 0.05, 0.0))
    plant.advance(0.6)
    tilt_rad, share = math.radians(30.0), 60_000 / 65_535
    thrust_n = (HOVER + 0.05) * share * 4 * DRONE.parameters()["thrust_max"]
    expected = flown_by_the_package(np.array([0.2 * tilt_rad, 0.3 * tilt_rad, 0.0, thrust_n]), 0.6)
    x, y, z, yaw, forward, left, up, _ = plant.motion
    assert yaw == pytest.approx(0.0, abs=0.05)
    turned = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]) @ (forward, left)
    assert np.allclose((x, y, z, *turned, up), expected, atol=4e-3)


@pytest.mark.parametrize("yaw_rad", [2.5, -4.0])
def test_it_flies_alike_in_all_directions(yaw_rad: float) -> None:
    plants = flying(), flying(yaw_rad=yaw_rad)
    for plant in plants:
        plant.set_input(CIRCLE)
        plant.advance(1.0)
    north, turned = (np.array(plant.motion) for plant in plants)
    assert turned[3] - yaw_rad == pytest.approx(north[3])
    assert turned[4:] == pytest.approx(north[4:])
    assert np.hypot(*turned[:2]) == pytest.approx(np.hypot(*north[:2]))


@pytest.mark.parametrize("kind", IDENTIFIED)
def test_every_identified_vehicle_hovers_at_rest_and_obeys_its_sticks(kind: str) -> None:
    plant = flying(IdentifiedCrazyflie(kind))
    plant.advance(2.0)
    assert np.allclose(plant.motion, (0, 0, 9.0, 0, 0, 0, 0, 0), atol=1e-6)
    hover = exact_crazyflie(plant.vehicle).hover_thrust
    plant.set_input((0.2, 0.2, hover, 0.5))
    plant.advance(0.4)
    assert plant.pose.pitch_rad > 0.03
    assert plant.pose.roll_rad < -0.03
    assert plant.motion[4] > 0.05
    assert plant.motion[5] > 0.05
    plant.advance(1.0)
    assert plant.motion[7] == pytest.approx(0.5 * math.radians(200.0), rel=0.05)


def test_it_leaves_the_floor_when_its_thrust_exceeds_its_weight_and_comes_down_without_motors() -> None:
    plant = CrazyfliePlant("h1", CRAZYFLIE, PROMPT, 0, BodyPose((0.0, 0.0, 0.0), 1.0), DRONE)
    plant.set_input((0.5, 0.0, 0.95 * HOVER, 0.5))
    plant.advance(2.0)
    assert plant.on_floor
    assert plant.motion == (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    plant.set_input((0.0, 0.0, 1.1 * HOVER, 0.0))
    plant.advance(2.0)
    assert not plant.on_floor
    assert plant.motion[2] > 0.1
    plant.stop_motors()
    plant.advance(3.0)
    assert (plant.on_floor, plant.touchdowns) == (True, 1)
    assert plant.touchdown_speed_m_s is not None
    assert plant.touchdown_speed_m_s > 0.5


def climb_m_s(conditions: Conditions = PROMPT, faults: PlantFaults | None = None) -> float:
    plant = flying(conditions=conditions)
    plant.faults = faults or PlantFaults()
    plant.set_input((0.0, 0.0, HOVER, 0.0))
    plant.advance(1.0)
    return plant.motion[6]


def test_battery_and_faults_use_its_thrust() -> None:
    empty = replace(PROMPT, battery_sag=0.2, battery_endurance_s=1.0)
    assert climb_m_s() == pytest.approx(0.0, abs=1e-6)
    assert climb_m_s(empty) < -0.1
    assert climb_m_s(faults=PlantFaults(thrust_factor=0.9)) < -0.1


def test_a_loop_with_half_of_its_torque_begins_to_tilt_half_as_fast() -> None:
    tilts_rad = []
    for gain in (1.0, 0.5):
        plant = flying()
        plant.faults = PlantFaults(attitude_gain=gain)
        plant.set_input((0.3, 0.0, HOVER, 0.0))
        plant.advance(0.02)
        tilts_rad.append(plant.pose.pitch_rad)
    assert tilts_rad[1] == pytest.approx(0.5 * tilts_rad[0], rel=0.1)


def test_trim_offsets_its_sticks_and_markers_are_tilted() -> None:
    trim: Four = (0.02, 0.0, 0.0, 0.0)
    plant = flying(replace(DRONE, trim=trim, marker_tilt_rad=(0.05, -0.03)))
    assert plant.marker_pose.pitch_rad == pytest.approx(0.05)
    assert plant.marker_pose.roll_rad == pytest.approx(-0.03)
    plant.advance(1.0)
    assert plant.motion[4] > 0.03


def test_vehicles_are_drawn_by_name_and_seed() -> None:
    drawn = crazyflie_of("h1", CRAZYFLIES, 3)
    assert crazyflie_of("h1", CRAZYFLIES, 3) == drawn
    others = [
        crazyflie_of(name, CRAZYFLIES, seed) for name, seed in (("h2", 3), ("h1", 4), ("h3", 5), ("h4", 6))
    ]
    assert drawn not in others
    assert len({other.drone for other in (drawn, *others)}) > 1
    named = crazyflie_of("h1", replace(CRAZYFLIES, attitude_plant="drone_models:cf21B_500"), 3)
    assert (named.drone, named.scales) == ("cf21B_500", ())
    assert 0 < max(map(abs, named.trim)) <= CRAZYFLIES.trim_offset


def test_the_laboratory_flies_them_where_the_conditions_say_so() -> None:
    start = {"h1": BodyPose((0.0, 0.0, 1.0))}
    plant = Laboratory({"h1": CRAZYFLIE}, start, CRAZYFLIES, 5).plants["h1"]
    assert isinstance(plant, CrazyfliePlant)
    assert plant.vehicle == crazyflie_of("h1", CRAZYFLIES, 5)


@pytest.mark.parametrize(
    ("plant", "reason"),
    [
        ("drone_models:balloon", "unknown kind 'balloon'; allowed: cf2x_L250"),
        ("balloons:red", "no installed package has the plant balloons:red"),
    ],
)
def test_a_plant_that_is_not_there_is_refused_with_the_reason(plant: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        added_plant(plant)
