"""Vehicles whose sticks act the wrong way land from the first 0.3 m: true heights in the simulator."""

import math
from collections.abc import Callable

import pytest
from msgspec import structs
from support.take_offs import TakeOffs, View

from rcopterx.simulator.plant import BodyPose, PlantFaults
from rcopterx.transmitter_gateway.inputs import State
from rcopterx.vehicles.phases import Phase

TYPES = ["coaxial", "crazyflie", "betaflight", "mavlink_quadrotor", "ardupilot_quadrotor"]
HIGHEST_M = 0.3
HARDEST_M_S = 1.0
FARTHEST_M = 0.7
OFF = (State.DISARMED, State.CUT)
FAULTS = {
    "pitch acts the wrong way": PlantFaults(stick_gain=(-1.0, 1.0, 1.0, 1.0)),
    "roll acts the wrong way": PlantFaults(stick_gain=(1.0, -1.0, 1.0, 1.0)),
    "yaw acts the wrong way": PlantFaults(stick_gain=(1.0, 1.0, 1.0, -1.0)),
    "pitch and roll are exchanged": PlantFaults(exchanged=True),
}


def flown(bench: TakeOffs) -> tuple[float, str]:
    """Take off until the motors are off; return how far it came, and the remark of the agent."""
    x, y, _ = bench.plants["h1"].position_m
    bench.take_off("h1")
    far_m, remark = 0.0, ""
    for _ in range(60):
        bench.run(0.1)
        far_m = max(far_m, math.dist(bench.plants["h1"].position_m[:2], (x, y)))
        remark = " ".join(bench.pilots["h1"].remarks) or remark
        if bench.arbiters["h1"].state in OFF:
            bench.run(0.6)
            break
    return far_m, remark


def landed_at_once(bench: TakeOffs, cause: str) -> None:
    far_m, remark = flown(bench)
    assert cause in remark
    assert bench.arbiters["h1"].state in OFF
    assert bench.plants["h1"].on_floor
    assert bench.highest_m["h1"] < HIGHEST_M
    assert bench.hardest_m_s["h1"] < HARDEST_M_S
    assert far_m < FARTHEST_M


CASES = [
    *((kind, cause) for cause in ("pitch acts the wrong way", "yaw acts the wrong way") for kind in TYPES),
    *(("coaxial", cause) for cause in list(FAULTS)[3:]),
    ("betaflight", "roll acts the wrong way"),
]


@pytest.mark.parametrize(("kind", "cause"), CASES)
def test_a_stick_that_acts_wrongly_ends_the_take_off_below_03_m(kind: str, cause: str) -> None:
    bench = TakeOffs({"h1": kind})
    bench.plants["h1"].faults = FAULTS[cause]
    landed_at_once(bench, cause)


@pytest.mark.parametrize("seed", [0, 8, 10, 15])
def test_a_vehicle_whose_sticks_one_round_of_pulses_does_not_prove_waits_with_its_climb(seed: int) -> None:
    bench = TakeOffs({"h1": "coaxial"}, "helicopters", seed=seed)
    bench.plants["h1"].faults = FAULTS["pitch acts the wrong way"]
    _, remark = flown(bench)
    assert "pitch" in remark
    assert bench.plants["h1"].on_floor
    assert bench.highest_m["h1"] < HIGHEST_M
    assert bench.hardest_m_s["h1"] < HARDEST_M_S


def turned(view: View, by_rad: float) -> Callable[[], BodyPose]:
    """View of a subject that was created with its nose elsewhere: its tilt is that of the vehicle."""

    def pose() -> BodyPose:
        seen = view()
        assert seen is not None
        c, s = math.cos(by_rad), math.sin(by_rad)
        forward, left = seen.pitch_rad, -seen.roll_rad
        return structs.replace(
            seen,
            yaw_rad=math.remainder(seen.yaw_rad + by_rad, math.tau),
            pitch_rad=c * forward + s * left,
            roll_rad=s * forward - c * left,
        )

    return pose


@pytest.mark.parametrize(
    ("kind", "by_rad", "side"),
    [*((kind, math.pi, "backwards") for kind in TYPES), ("coaxial", 0.5 * math.pi, "to the left")],
)
def test_a_nose_that_points_elsewhere_ends_the_take_off_below_03_m(
    kind: str, by_rad: float, side: str
) -> None:
    bench = TakeOffs({"h1": kind})
    bench.views["h1"] = turned(bench.views["h1"], by_rad)
    landed_at_once(bench, f"the nose of the subject points {side}?")


@pytest.mark.parametrize("kind", ["coaxial", "crazyflie"])
def test_positions_alone_show_a_reversed_stick(kind: str) -> None:
    bench = TakeOffs({"h1": kind}, measured_tilt=False)
    bench.plants["h1"].faults = FAULTS["pitch acts the wrong way"]
    landed_at_once(bench, "pitch acts the wrong way")


@pytest.mark.parametrize("kind", ["coaxial", "crazyflie"])
def test_positions_alone_raise_no_false_alarm(kind: str) -> None:
    bench = TakeOffs({"h1": kind}, measured_tilt=False)
    bench.take_off("h1")
    bench.run(3.0)
    assert bench.pilots["h1"].vehicle_watch.fault is None
    assert bench.arbiters["h1"].state is State.ARMED
    assert bench.highest_m["h1"] > HIGHEST_M


def test_a_take_off_that_was_given_up_is_repeated_once_a_person_has_armed_again() -> None:
    bench = TakeOffs({"h1": "coaxial"})
    bench.plants["h1"].faults = FAULTS["pitch acts the wrong way"]
    landed_at_once(bench, "pitch acts the wrong way")
    bench.run(2.0)
    assert bench.arbiters["h1"].state is State.DISARMED
    assert "given up: pitch acts the wrong way" in bench.arbiters["h1"].reason
    assert bench.pilots["h1"].remarks
    bench.plants["h1"].faults = PlantFaults()
    bench.take_off("h1")
    bench.run(3.0)
    assert bench.pilots["h1"].guidance.phase in (Phase.TAKEOFF, Phase.FLYING)
    assert not bench.pilots["h1"].remarks
