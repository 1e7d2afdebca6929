"""A lift-off that ends where the vehicle is seen to fly brings it down under power: true heights."""

import math
from dataclasses import replace

import pytest
from msgspec import structs
from support.take_offs import TakeOffs, View

from rcopterx.simulator.first_order_plant import FirstOrderPlant
from rcopterx.simulator.plant import BodyPose
from rcopterx.transmitter_gateway.inputs import State

FREE_FALL_M_S2, GENTLE_M_S = 9.81, 1.0
LIGHT = 0.37 / 0.5  # ArduCopter in software hovers with 0.37, and its type says 0.5
STEP_M = 0.011


def lighter(bench: TakeOffs, share: float) -> None:
    """Make the vehicle hover with a share of the hover thrust of its type."""
    plant = bench.plants["h1"]
    assert isinstance(plant, FirstOrderPlant)
    pitch, roll, _, yaw = plant.model.input_gain
    hover = share * plant.model.hover_thrust
    plant.model = replace(
        plant.model, input_gain=(pitch, roll, FREE_FALL_M_S2 / hover, yaw), hover_thrust=hover
    )


def coarse(seen: View, together: int) -> View:
    """Poses in steps of 11 mm, of which only the last one of several is shown, until the next ones arrive."""
    shown: list[BodyPose] = []
    number = 0

    def pose() -> BodyPose | None:
        nonlocal number
        found = seen()
        number += 1
        if found is not None and (not shown or number % together == 0):
            x, y, z = found.position_m
            places = tuple(STEP_M * round(part / STEP_M) for part in (x, y))
            noise = 1e-4 * (number % 7)
            shown[:] = [structs.replace(found, position_m=(*places, STEP_M * math.floor(z / STEP_M) + noise))]
        return structs.replace(
            shown[0], position_m=(*shown[0].position_m[:2], shown[0].position_m[2] + 1e-5 * (number % 3))
        )

    return pose


def shifted(seen: View, by_m: float) -> View:
    """Poses of a vehicle whose markers were found again at another place of its body."""

    def pose() -> BodyPose | None:
        found = seen()
        assert found is not None
        x, y, z = found.position_m
        return structs.replace(found, position_m=(x + by_m, y, z))

    return pose


@pytest.mark.parametrize("share", [LIGHT, 0.85, 1.0])
@pytest.mark.parametrize("begins_s", [0.75, 0.8, 0.85, 0.9, 1.0])
def test_a_pose_that_jumps_in_the_air_does_not_stop_the_motors_there(share: float, begins_s: float) -> None:
    bench = TakeOffs({"h1": "mavlink_quadrotor"})
    lighter(bench, share)
    bench.take_off("h1")
    bench.run(begins_s)
    bench.views["h1"] = shifted(bench.views["h1"], 0.2)
    bench.run(8.0)
    assert bench.plants["h1"].on_floor
    assert bench.hardest_m_s["h1"] < (GENTLE_M_S if share == LIGHT else 1.3), "0.4 m under 0.76 of its weight"
    assert bench.highest_m["h1"] < 1.0
    assert bench.arbiters["h1"].state in (State.CUT, State.ARMED, State.DISARMED)


@pytest.mark.parametrize("together", [1, 3, 4])
def test_a_light_vehicle_with_coarse_poses_in_bursts_does_not_fall(together: int) -> None:
    bench = TakeOffs({"h1": "mavlink_quadrotor"})
    lighter(bench, LIGHT)
    bench.views["h1"] = coarse(bench.views["h1"], together)
    bench.take_off("h1")
    bench.run(8.0)
    assert bench.hardest_m_s["h1"] < GENTLE_M_S
    if bench.arbiters["h1"].state is State.CUT:
        assert "lift-off: its pose" in bench.arbiters["h1"].reason


def test_the_pose_of_another_body_that_falls_does_not_raise_the_thrust_beyond_a_hover() -> None:
    bench = TakeOffs({"h1": "mavlink_quadrotor"})
    bench.take_off("h1")
    bench.run(0.9)
    seen, fallen_m = bench.views["h1"], 0.0

    def falling() -> BodyPose | None:
        nonlocal fallen_m
        found = seen()
        assert found is not None
        fallen_m += 0.03
        return structs.replace(found, position_m=(1.0, 0.3, max(3.0 - fallen_m, 0.2)))

    bench.views["h1"] = falling
    bench.run(8.0)
    assert bench.plants["h1"].on_floor
    assert bench.highest_m["h1"] < 1.0
