"""A lift-off that its own pose does not prove ends at once: true heights of the simulated vehicles."""

import random
from typing import Any

import pytest
from msgspec import structs
from support.take_offs import TakeOffs, View

from rcopterx.agents.flight.lift_off import FAILED_S
from rcopterx.simulator.plant import BodyPose
from rcopterx.transmitter_gateway.inputs import State


def some(*values: float) -> list[Any]:
    """Every other value, from the first on; the others are flown by `make campaign`."""
    return [
        pytest.param(value, marks=pytest.mark.campaign) if place % 2 else value
        for place, value in enumerate(values)
    ]


TYPES = ["coaxial", "crazyflie", "betaflight", "mavlink_quadrotor", "ardupilot_quadrotor"]
HIGHEST_M = 0.15
HARDEST_M_S = 1.0
FROM_STANDING_M = 0.28  # of a light vehicle in the hop of a pulse, which a body on the floor hides
FROM_STANDING_M_S = 1.2
HELD_CLIMB_M = 1.5  # until its thrust shows that a vehicle must have moved
FROM_CLEAR_M_S = 1.4  # of a vehicle that sinks from 0.4 m under 0.76 of its hover thrust


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("freezes_s", some(0.0, 0.2, 0.35, 0.45))
def test_a_pose_that_freezes_in_the_lift_off_stops_the_motors(kind: str, freezes_s: float) -> None:
    bench = TakeOffs({"h1": kind})
    bench.take_off("h1")
    bench.run(freezes_s)
    frozen = bench.views["h1"]()
    bench.views["h1"] = lambda: frozen
    bench.run(4.0)
    assert bench.highest_m["h1"] < HIGHEST_M
    assert bench.hardest_m_s["h1"] < HARDEST_M_S
    assert bench.plants["h1"].on_floor
    assert bench.arbiters["h1"].state is State.CUT
    assert bench.arbiters["h1"].reason == "lift-off: its pose repeats itself exactly: frozen"


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize(("rate_hz", "noise_m"), [(50, 0.0003), (100, 0.0015), (200, 0.0001)])
def test_an_ordinary_lift_off_is_not_stopped(kind: str, rate_hz: int, noise_m: float) -> None:
    bench = TakeOffs({"h1": kind}, rate_hz=rate_hz, position_noise_m=noise_m)
    bench.take_off("h1")
    assert bench.until_flying("h1", 4.0) < 4.0
    assert bench.arbiters["h1"].state is State.ARMED


def another_body(stands: BodyPose) -> View:
    """Poses of a body that stands where the vehicle stood."""
    noise = random.Random(1)

    def pose() -> BodyPose:
        place = tuple(value + noise.gauss(0.0, 3e-4) for value in stands.position_m)
        return structs.replace(stands, position_m=place)

    return pose


def raised(seen: View) -> View:
    """Poses of a vehicle that is shown 0.1 m higher."""

    def pose() -> BodyPose | None:
        if (found := seen()) is None:
            return None
        x, y, z = found.position_m
        return structs.replace(found, position_m=(x, y, z + 0.1))

    return pose


@pytest.mark.parametrize("kind", TYPES)
def test_a_vehicle_whose_subject_is_a_body_that_stands_rises_little_and_is_stopped(kind: str) -> None:
    bench = TakeOffs({"h1": kind})
    stands = bench.views["h1"]()
    assert stands is not None
    bench.views["h1"] = another_body(stands)
    bench.take_off("h1")
    bench.run(FAILED_S + 2.0)
    assert bench.highest_m["h1"] < HIGHEST_M
    assert bench.hardest_m_s["h1"] < HARDEST_M_S
    assert bench.arbiters["h1"].state is State.CUT
    assert "another body" in bench.arbiters["h1"].reason


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("wrong", ["another body", "frozen", "raised"])
@pytest.mark.parametrize("begins_s", some(0.7, 0.8, 0.9, 1.0, 1.1))
def test_a_pose_that_becomes_wrong_just_after_the_lift_off_ends_it_below_0_4_m(
    kind: str, wrong: str, begins_s: float
) -> None:
    bench = TakeOffs({"h1": kind})
    stands = bench.views["h1"]()
    bench.take_off("h1")
    bench.run(begins_s)
    seen, frozen = bench.views["h1"], bench.views["h1"]()
    assert stands is not None
    bench.views["h1"] = {
        "another body": another_body(stands),
        "frozen": lambda: frozen,
        "raised": raised(seen),
    }[wrong]
    bench.run(4.0)
    assert bench.highest_m["h1"] < 0.4
    assert bench.hardest_m_s["h1"] < FROM_CLEAR_M_S
    assert bench.plants["h1"].on_floor
    assert bench.arbiters["h1"].state is State.CUT
    assert "lift-off: its pose" in bench.arbiters["h1"].reason


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("begins_s", some(0.5, 0.55, 0.6, 0.65))
def test_a_body_that_stands_in_the_place_of_a_vehicle_that_has_just_lifted_brings_it_back_to_the_floor(
    kind: str, begins_s: float
) -> None:
    conditions = "crazyflies" if kind in ("coaxial", "crazyflie") else "helicopters"
    for seed in (1, 3):
        bench = TakeOffs({"h1": kind}, conditions, seed=seed)
        stands = bench.views["h1"]()
        assert stands is not None
        bench.take_off("h1")
        bench.run(begins_s)
        bench.views["h1"] = another_body(stands)
        bench.run(FAILED_S + 2.0)
        assert bench.highest_m["h1"] < FROM_STANDING_M
        assert bench.hardest_m_s["h1"] < FROM_STANDING_M_S
        assert bench.arbiters["h1"].state is State.CUT


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("begins_s", [1.0, 1.5, 2.5])
def test_a_pose_that_is_held_with_noise_in_a_climb_ends_the_flight(kind: str, begins_s: float) -> None:
    bench = TakeOffs({"h1": kind})
    bench.take_off("h1")
    bench.run(begins_s)
    held = bench.views["h1"]()
    assert held is not None
    bench.views["h1"] = another_body(held)
    bench.run(8.0)
    assert bench.highest_m["h1"] < held.position_m[2] + HELD_CLIMB_M
    assert bench.plants["h1"].on_floor
    assert bench.arbiters["h1"].state is State.CUT


@pytest.mark.parametrize("kind", TYPES)
def test_a_vehicle_that_is_shown_higher_while_it_waits_for_its_turn_stays_on_the_floor(kind: str) -> None:
    bench = TakeOffs({"h1": kind})
    bench.pilots["h1"].lift_off_delay_s = 0.55
    bench.take_off("h1")
    bench.run(0.2)
    bench.views["h1"] = raised(bench.views["h1"])
    bench.run(4.0)
    assert bench.highest_m["h1"] == 0.0
    assert bench.arbiters["h1"].state is State.DISARMED
    assert "h1 moves: 100 mm on the floor" in bench.arbiters["h1"].reason


def exchange(bench: TakeOffs) -> None:
    bench.views["h1"], bench.views["h2"] = bench.views["h2"], bench.views["h1"]


@pytest.mark.parametrize("kind", TYPES)
def test_exchanged_subjects_stop_the_motors_when_the_other_vehicle_rises(kind: str) -> None:
    bench = TakeOffs({"h1": kind, "h2": kind})
    exchange(bench)
    bench.take_off("h1")
    bench.run(4.0)
    assert max(bench.highest_m.values()) < HIGHEST_M
    assert max(bench.hardest_m_s.values()) < HARDEST_M_S
    reason = bench.arbiters["h1"].reason
    assert reason == "lift-off: h2 rose when the rotor of h1 turned: subjects or radios exchanged?"


@pytest.mark.parametrize("kind", TYPES)
def test_exchanged_radios_stop_the_motors_when_the_other_vehicle_rises(kind: str) -> None:
    bench = TakeOffs({"h1": kind, "h2": kind})
    bench.radios = {"h1": "h2", "h2": "h1"}
    bench.take_off("h1")
    bench.run(4.0)
    assert max(bench.highest_m.values()) < HIGHEST_M
    assert max(bench.hardest_m_s.values()) < HARDEST_M_S


@pytest.mark.parametrize("kind", TYPES)
def test_two_vehicles_that_take_off_at_once_are_not_stopped(kind: str) -> None:
    bench = TakeOffs({"h1": kind, "h2": kind})
    bench.take_off("h1", "h2")
    bench.run(4.0)
    assert all(arbiter.state is State.ARMED for arbiter in bench.arbiters.values())
    assert min(bench.highest_m.values()) > 0.3
