"""Descents of the arbiter, flown: vehicles that are not as calibrated land gently all the same."""

import pytest
from arbiter_bench import PERIOD_S, U_HOVER, Bench
from support.conditions import LABORATORY
from support.vehicle_types import COAXIAL_LAG

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import BodyPose
from rcopterx.transmitter_gateway.inputs import Position, State
from rcopterx.vehicles.state import U_THRUST, ZD_BODY

HEIGHT_M = 0.9
HOVER_S = 3.0


def touchdown_m_s(seed: int, limits: ArbiterLimits, hover_m: float = HEIGHT_M) -> float:
    """Hover a simulated vehicle, then end its commands and poses; returns the speed at which it lands."""
    laboratory = Laboratory({"h1": COAXIAL_LAG}, {"h1": BodyPose((0.0, 0.0, hover_m), 0.0)}, LABORATORY, seed)
    plant = laboratory.plants["h1"]
    bench = Bench(limits)
    bench.position = (0.0, 0.0, hover_m)
    bench.fly((0.0, 0.0, 0.55, 0.0))
    bench.yaw_rad = 0.0
    hover = plant.model.gravity_m_s2 / plant.model.input_gain[U_THRUST] - plant.trim[U_THRUST]
    for tick in range(round((HOVER_S + 6.0) / PERIOD_S)):
        laboratory.advance(PERIOD_S)
        height_m = laboratory.measured_pose("h1").position_m[2]
        feedback = 0.12 * (hover_m - height_m) - 0.09 * plant.motion[ZD_BODY]
        hovers = tick * PERIOD_S < HOVER_S
        bench.position = (0.0, 0.0, height_m) if hovers else None
        bench.run(PERIOD_S, (0.0, 0.0, hover + feedback, 0.0) if hovers else None)
        output = bench.outputs[-1]
        if output.state is State.CUT:
            laboratory.plants["h1"].stop_motors()
        else:
            laboratory.plants["h1"].set_input(output.u)
        if plant.on_floor:
            break
    assert plant.touchdown_speed_m_s is not None
    return plant.touchdown_speed_m_s


@pytest.mark.parametrize(("hover_m", "fastest_m_s"), [(0.5, 1.1), (HEIGHT_M, 1.35), (1.5, 1.65), (2.2, 2.0)])
def test_vehicles_land_gently_whatever_their_true_hover_thrust_is(hover_m: float, fastest_m_s: float) -> None:
    speeds_m_s = [touchdown_m_s(seed, ArbiterLimits(), hover_m) for seed in range(12)]
    assert max(speeds_m_s) < fastest_m_s


def test_without_the_correction_of_the_hover_thrust_they_do_not() -> None:
    speeds_m_s = [touchdown_m_s(seed, ArbiterLimits(hover_correction=0.0)) for seed in range(12)]
    assert max(speeds_m_s) > 2.5


def thrusts_after_poses_end(position_m: Position, thrust: float) -> list[float]:
    """Fly, lower the thrust for a moment, and see no pose any more; thrusts of the arbiter after that."""
    bench = Bench()
    bench.yaw_rad, bench.position = 0.0, position_m
    bench.fly((0.0, 0.0, U_HOVER if position_m[2] > 0.0 else thrust, 0.0))
    bench.position = None
    while bench.state is State.ARMED:
        bench.run(PERIOD_S, (0.0, 0.0, thrust, 0.0))
    return [bench.wait(PERIOD_S).u[U_THRUST] for _ in range(10)]


def test_a_thrust_that_was_low_for_a_moment_in_the_air_is_raised_to_that_of_a_hover() -> None:
    thrusts = thrusts_after_poses_end((0.0, 0.0, 1.0), 0.3)
    assert 0.8 * U_HOVER < max(thrusts) <= U_HOVER + 0.01


def test_on_the_floor_it_is_not_raised() -> None:
    assert max(thrusts_after_poses_end((0.0, 0.0, 0.0), 0.3)) <= 0.3


@pytest.mark.parametrize("silent_s", [2.4, 3.0, 3.6])
def test_a_vehicle_that_is_seen_again_on_the_floor_after_its_descent_stays_there(silent_s: float) -> None:
    bench = Bench()
    bench.yaw_rad = 0.0
    bench.position = (0.0, 0.0, 1.0)
    bench.fly((0.0, 0.0, U_HOVER, 0.0))
    bench.position = None
    bench.run(silent_s, (0.0, 0.0, U_HOVER, 0.0))
    assert bench.state is State.DESCEND
    bench.position = (0.0, 0.0, 0.0)
    bench.run(0.1, (0.0, 0.0, U_HOVER, 0.0))
    assert bench.state is State.CUT
    assert bench.reason == "landed: raw poses: own pose lost for 0.3 s"
