"""Descents of the arbiter, flown: vehicles that are not as calibrated land gently all the same."""

from arbiter_bench import PERIOD_S, Bench
from support.vehicle_types import COAXIAL_LAG

from rcopterx.simulator.conditions import LABORATORY
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.plant import Pose
from rcopterx.transmitter_gateway.inputs import State
from rcopterx.transmitter_gateway.limits import ArbiterLimits
from rcopterx.vehicles.state import U_THRUST, ZD_BODY

HEIGHT_M = 0.9
HOVER_S = 3.0


def touchdown_m_s(seed: int, limits: ArbiterLimits) -> float:
    """Hover a simulated vehicle, then end its commands and poses; returns the speed at which it lands."""
    laboratory = Laboratory({"h1": COAXIAL_LAG}, {"h1": Pose((0.0, 0.0, HEIGHT_M), 0.0)}, LABORATORY, seed)
    plant = laboratory.plants["h1"]
    bench = Bench(limits)
    bench.position = (0.0, 0.0, HEIGHT_M)
    bench.fly((0.0, 0.0, 0.55, 0.0))
    bench.yaw_rad = 0.0
    hover = plant.model.gravity_m_s2 / plant.model.input_gain[U_THRUST] - plant.trim[U_THRUST]
    for tick in range(round((HOVER_S + 4.0) / PERIOD_S)):
        laboratory.advance(PERIOD_S)
        height_m = laboratory.measured_pose("h1").position_m[2]
        feedback = 0.12 * (HEIGHT_M - height_m) - 0.09 * plant.motion[ZD_BODY]
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


def test_vehicles_land_gently_whatever_their_true_hover_thrust_is() -> None:
    speeds_m_s = [touchdown_m_s(seed, ArbiterLimits()) for seed in range(12)]
    assert max(speeds_m_s) < 1.7


def test_without_the_correction_of_the_hover_thrust_they_do_not() -> None:
    speeds_m_s = [touchdown_m_s(seed, ArbiterLimits(hover_correction=0.0)) for seed in range(12)]
    assert max(speeds_m_s) > 2.5
