"""Vehicles of the simulated laboratory break and mend when a request or its time table says so."""

from contextlib import nullcontext

import pytest
from msgspec import structs
from support.conditions import HELICOPTER, IDEAL
from support.vehicle_types import COAXIAL, QUADROTOR

from rcopterx.simulator.faults import BreakVehicle, Close, FaultError, Recover, TimedFault
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose, Plant, PlantFaults
from rcopterx.simulator.vehicle_faults import VehicleFaults
from rcopterx.vehicles.model import Model

SOUND = PlantFaults()


@pytest.fixture
def plants() -> dict[str, Plant]:
    start = {name: BodyPose((0.0, 0.0, 1.0)) for name in ("h1", "h2")}
    laboratory = Laboratory(dict.fromkeys(start, COAXIAL), start, IDEAL)
    return {name: laboratory.plants[name] for name in start}


@pytest.mark.parametrize(
    ("fault", "plant_faults"),
    [
        (BreakVehicle("h1", thrust_factor=0.6), PlantFaults(thrust_factor=0.6)),
        (BreakVehicle("h1", dead="roll"), PlantFaults(stick_gain=(1.0, 0.0, 1.0, 1.0))),
        (BreakVehicle("h1", reversed="yaw"), PlantFaults(stick_gain=(1.0, 1.0, 1.0, -1.0))),
        (BreakVehicle("h1", cyclic_factor=5.0), PlantFaults(stick_gain=(5.0, 5.0, 1.0, 1.0))),
        (BreakVehicle("h1", attitude_gain=0.5), PlantFaults(attitude_gain=0.5)),
        (BreakVehicle("h1", delay_s=0.1), PlantFaults(delay_s=0.1)),
        (BreakVehicle("h1", exchanged=True), PlantFaults(exchanged=True)),
        (BreakVehicle("h1", stuck="roll"), PlantFaults(stuck=frozenset({1}))),
        (BreakVehicle("h1", trim=(0.0, 0.1, 0.0, 0.0)), PlantFaults(trim=(0.0, 0.1, 0.0, 0.0))),
    ],
)
def test_a_vehicle_breaks_in_its_time_and_is_sound_afterwards(
    fault: BreakVehicle, plant_faults: PlantFaults, plants: dict[str, Plant]
) -> None:
    faults = VehicleFaults(plants, {})
    lasting = structs.replace(fault, duration_s=0.5)
    faults.schedule([TimedFault(1.0, lasting)], 10.0)
    for now_s, found in ((10.9, SOUND), (11.0, plant_faults), (11.4, plant_faults), (11.5, SOUND)):
        faults.advance(now_s)
        assert plants["h1"].faults == found
        assert plants["h2"].faults == SOUND
        assert faults.table.active == ((lasting,) if found != SOUND else ())


def test_recover_mends_everything(plants: dict[str, Plant]) -> None:
    faults = VehicleFaults(plants, {})
    faults.schedule([TimedFault(0.0, BreakVehicle("h2", dead="pitch")), TimedFault(1.0, Recover())], 0.0)
    faults.advance(0.5)
    assert plants["h2"].faults != SOUND
    faults.advance(1.5)
    assert plants["h2"].faults == SOUND


def test_a_fault_of_an_unknown_vehicle_is_refused(plants: dict[str, Plant]) -> None:
    faults = VehicleFaults(plants, {})
    faults.check([TimedFault(0.0, Close())])
    with pytest.raises(FaultError, match="no vehicle 'h9', there are h1, h2"):
        faults.check([TimedFault(0.0, BreakVehicle("h9"))])


@pytest.mark.parametrize(
    ("model", "refused", "reason"),
    [
        (QUADROTOR, BreakVehicle("h1", cyclic_factor=8.0), "its firmware keeps the attitude"),
        (COAXIAL, BreakVehicle("h1", attitude_gain=0.5), "it has no attitude loop"),
    ],
)
def test_faults_of_a_swash_plate_and_of_an_attitude_loop_are_refused_for_vehicles_without_one(
    model: Model, refused: BreakVehicle, reason: str
) -> None:
    faults = VehicleFaults(
        Laboratory({"h1": model}, {"h1": BodyPose((0.0, 0.0, 1.0))}, HELICOPTER).plants, {}
    )
    both = BreakVehicle("h1", cyclic_factor=8.0), BreakVehicle("h1", attitude_gain=0.5)
    for fault in both:
        with pytest.raises(FaultError, match=f"h1: {reason}") if fault == refused else nullcontext():
            faults.check([TimedFault(0.0, fault)])


def test_exchanged_sticks_pitch_by_roll_and_roll_by_pitch(plants: dict[str, Plant]) -> None:
    plants["h1"].faults = PlantFaults(exchanged=True)
    plants["h1"].set_input((0.2, 0.0, 0.55, 0.0))
    plants["h2"].set_input((0.0, 0.2, 0.55, 0.0))
    for plant in plants.values():
        plant.advance(0.5)
    assert plants["h1"].motion == plants["h2"].motion
    assert abs(plants["h1"].position_m[1]) > 0.01
