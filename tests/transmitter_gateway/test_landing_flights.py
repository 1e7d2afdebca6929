"""Flights of vehicles without commands: held and landed by the arbiter as long as they are seen."""

import math
from dataclasses import replace

import pytest
from landing_flight import HOVER_S, Flight, Landing, Options, landing
from support.conditions import HELICOPTER, HELICOPTERS, LABORATORY
from support.vehicle_types import QUADROTOR

from rcopterx.radios.limits import Fence
from rcopterx.simulator.conditions import Conditions
from rcopterx.transmitter_gateway.inputs import State

CONDITIONS = {"first order": LABORATORY, "helicopter": HELICOPTER, "drawn helicopters": HELICOPTERS}
KINDS = pytest.mark.parametrize("conditions", CONDITIONS.values(), ids=CONDITIONS)


@pytest.fixture(
    params=[range(2), pytest.param(range(2, 6), marks=pytest.mark.campaign)], ids=["each time", "campaign"]
)
def seeds(request: pytest.FixtureRequest) -> range:
    """Of flights that differ in their weather, and drawn helicopters in everything."""
    found: range = request.param
    return found


def assert_gentle(flown: Landing, offset_m: float = 0.3, touchdown_m_s: float = 0.6) -> None:
    assert flown.reason == "landed: commands silent"
    assert State.DESCEND not in flown.states
    assert flown.offset_m < offset_m
    assert flown.touchdown_m_s < touchdown_m_s
    assert flown.hardest_m_s < 1.0


@KINDS
def test_vehicle_that_hovers_lands_where_it_was(conditions: Conditions, seeds: range) -> None:
    for seed in seeds:
        assert_gentle(landing(conditions, seed))


def test_quadrotor_lands_where_it_was(seeds: range) -> None:
    for seed in seeds:
        assert_gentle(landing(LABORATORY, seed, Options(model=QUADROTOR)))


@KINDS
@pytest.mark.parametrize(
    "push", [(0.4, 0.4, 0.0), (0.0, 0.0, 0.05), (0.0, 0.0, -0.04)], ids=["fast", "climbing", "sinking"]
)
def test_vehicle_that_moves_is_braked_and_lands(
    conditions: Conditions, push: tuple[float, float, float], seeds: range
) -> None:
    for seed in seeds:
        assert_gentle(landing(conditions, seed, Options(push=push)))


@KINDS
@pytest.mark.parametrize("gain", [0.5, 1.5])
def test_half_to_one_and_a_half_times_the_nominal_gain_lands_all_the_same(
    conditions: Conditions, gain: float, seeds: range
) -> None:
    # Gusts tilt helicopters, and half the gain holds them half as well.
    offset_m = 0.4 if gain < 1.0 else 0.3
    for seed in seeds:
        assert_gentle(landing(conditions, seed, Options(gain=gain, height_m=1.2)), offset_m)


@pytest.mark.parametrize("height_m", [0.3, 2.0])
def test_height_does_not_matter(height_m: float, seeds: range) -> None:
    for seed in seeds:
        assert_gentle(landing(HELICOPTER, seed, Options(height_m=height_m)))


@KINDS
@pytest.mark.parametrize("gain", [1.0, 2.0])
def test_twice_the_nominal_gain_swings_no_vehicle_up(
    conditions: Conditions, gain: float, seeds: range
) -> None:
    for seed in seeds:
        flight = Flight(conditions, seed, Options(gain=gain))
        flight.fly(12.0)
        place = flight.plant.pose.position_m
        sticks = []
        for _ in range(150):
            flight.fly(0.02)
            sticks.append(math.hypot(*flight.bench.outputs[-1].u[:2]))
        assert math.hypot(*place[:2]) < 0.25
        assert math.sqrt(sum(stick**2 for stick in sticks) / len(sticks)) < 0.2


@KINDS
def test_vehicle_that_came_too_close_to_another_one_moves_apart_and_lands(
    conditions: Conditions, seeds: range
) -> None:
    other_m = (0.12, 0.12, 0.9)
    for seed in seeds:
        flown = landing(conditions, seed, Options(other_m=other_m))
        assert_gentle(flown, offset_m=0.6)
        assert math.dist(flown.landed_m[:2], other_m[:2]) > 0.25


def test_vehicle_that_is_lost_on_the_way_comes_down_open_loop() -> None:
    flown = landing(HELICOPTER, 0, Options(seen=lambda seconds: seconds < 1.5))
    assert flown.states[-3:] == (State.LAND, State.DESCEND, State.CUT)
    assert flown.reason == "descent over: commands silent"


def test_vehicle_that_is_seen_again_lands_gently() -> None:
    flown = landing(HELICOPTER, 0, Options(seen=lambda seconds: not 1.2 < seconds < 1.6))
    assert flown.states[-4:] == (State.LAND, State.DESCEND, State.LAND, State.CUT)
    assert flown.reason == "landed: commands silent"
    assert flown.touchdown_m_s < 0.6


@KINDS
@pytest.mark.parametrize("unseen_s", [1.2, 1.4])
def test_vehicle_that_has_sunk_while_nobody_saw_it_is_believed_and_lands_gently(
    conditions: Conditions, unseen_s: float, seeds: range
) -> None:
    """A Vicon gateway that is restarted without a spare process is away for so long."""
    for seed in seeds:
        flown = landing(
            conditions, seed, Options(height_m=1.5, seen=lambda seconds: not 0.0 < seconds < unseen_s)
        )
        assert State.DESCEND in flown.states
        assert flown.reason == "landed: commands silent"
        assert flown.touchdown_m_s < 0.6


@KINDS
@pytest.mark.parametrize("thrust", [-0.2, 0.25], ids=["sinking", "climbing"])
def test_vehicle_that_moved_while_the_computer_was_starved_is_believed_and_lands_gently(
    conditions: Conditions, thrust: float, seeds: range
) -> None:
    for seed in seeds:
        flight = Flight(conditions, seed, Options(height_m=1.5))
        flight.fly(3.0)
        flight.fly(0.2, (0.3, 0.3, thrust))
        flight.starve(0.4)
        flown = flight.end_commands()
        assert flown.reason == "landed: raw poses: own pose lost for 0.3 s"
        assert flown.touchdown_m_s < 0.6


@KINDS
def test_vehicle_survives_a_starved_computer_that_repeats_a_low_thrust(
    conditions: Conditions, seeds: range
) -> None:
    for seed in seeds:
        flight = Flight(conditions, seed, Options(height_m=1.2))
        flight.fly(HOVER_S)
        flight.fly(0.12, (0.0, 0.0, -0.45))
        flight.starve(0.45)
        flown = flight.end_commands()
        assert flown.reason == "landed: raw poses: own pose lost for 0.3 s"
        assert flown.hardest_m_s < 1.0


def test_occlusion_of_80_ms_is_flown_through() -> None:
    flown = landing(HELICOPTER, 0, Options(seen=lambda seconds: not 1.2 < seconds <= 1.28))
    assert_gentle(flown)


@KINDS
@pytest.mark.parametrize("push", [(0.1, 0.0, 0.0), (-0.3, 0.0, 0.0)], ids=["forwards", "backwards"])
def test_a_pitch_stick_that_acts_the_wrong_way_round_is_turned_round(
    conditions: Conditions, push: tuple[float, float, float], seeds: range
) -> None:
    for seed in seeds:
        flown = landing(conditions, seed, Options(pitch_acts=-1.0, push=push))
        assert flown.reason == "landed: commands silent"
        assert flown.farthest_m < 2.0
        assert flown.offset_m < 1.15
        assert flown.touchdown_m_s < 0.6


@pytest.mark.parametrize("push", [(0.1, 0.0, 0.0), (-0.3, 0.0, 0.0)], ids=["forwards", "backwards"])
def test_a_quadrotor_whose_pitch_stick_acts_the_wrong_way_round_is_braked(
    push: tuple[float, float, float], seeds: range
) -> None:
    for seed in seeds:
        flown = landing(LABORATORY, seed, Options(model=QUADROTOR, pitch_acts=-1.0, push=push))
        assert flown.reason == "landed: commands silent"
        assert flown.farthest_m < 1.5
        assert flown.offset_m < 1.2
        assert flown.touchdown_m_s < 0.6


@pytest.mark.parametrize("pitch", [-0.8, 0.8])
def test_a_quadrotor_that_is_fast_is_braked_also_with_a_reversed_pitch_stick(
    pitch: float, seeds: range
) -> None:
    for seed in seeds:
        sound = landing(LABORATORY, seed, Options(model=QUADROTOR, push=(pitch, 0.0, 0.0)))
        assert_gentle(sound, offset_m=0.6)
        assert sound.farthest_m < 1.2
        flown = landing(LABORATORY, seed, Options(model=QUADROTOR, pitch_acts=-1.0, push=(pitch, 0.0, 0.0)))
        assert flown.reason == "landed: commands silent"
        assert flown.farthest_m < 3.0
        assert flown.touchdown_m_s < 0.6


@KINDS
def test_a_pitch_stick_without_effect_lets_a_vehicle_drift_and_land(
    conditions: Conditions, seeds: range
) -> None:
    for seed in seeds:
        flown = landing(conditions, seed, Options(pitch_acts=0.0, push=(-0.3, 0.0, 0.0)))
        assert flown.reason == "landed: commands silent"
        assert flown.farthest_m < 3.0
        assert flown.touchdown_m_s < 0.6


@KINDS
@pytest.mark.parametrize("pitch", [-0.3, -0.1, 0.1, 0.3])
def test_a_vehicle_whose_pitch_is_stuck_is_down_before_it_is_cut(
    conditions: Conditions, pitch: float, seeds: range
) -> None:
    surveillance = replace(Options().limits.surveillance, fence=Fence((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0)))
    limits = replace(Options().limits, surveillance=surveillance)
    for seed in seeds:
        flown = landing(conditions, seed, Options(pitch_stuck_at=pitch, limits=limits))
        assert flown.reason == "landed: commands silent"
        assert flown.touchdown_m_s < 0.6


def test_a_vehicle_that_leaves_its_volume_all_the_same_is_cut() -> None:
    fence = Fence((-0.3, -0.3, 0.0), (0.3, 0.3, 2.0), cut_m=0.5)
    options = Options(pitch_acts=0.0, push=(-0.8, 0.0, 0.0), yaw_rad=0.0)
    limits = replace(options.limits, surveillance=replace(options.limits.surveillance, fence=fence))
    flown = landing(HELICOPTER, 0, replace(options, limits=limits))
    assert flown.reason == "far outside the fence: commands silent"
    assert State.LAND in flown.states
    assert flown.farthest_m < 2.0


def test_poses_that_get_stuck_end_the_closed_loop() -> None:
    options = Options()
    limits = replace(options.limits.surveillance, trust_repeated_poses=False)
    flight = Flight(HELICOPTER, 0, replace(options, limits=replace(options.limits, surveillance=limits)))
    flight.fly(3.0)
    for _ in range(50):
        flight.bench.run(0.02, None)
    assert flight.bench.state is State.DESCEND


@pytest.mark.parametrize("frames", [1, 4])
def test_other_bodys_poses_are_not_flown_by(frames: int) -> None:
    """A swap for a moment is flown through; one that stays ends the closed loop for good."""
    flight = Flight(HELICOPTER, 0, Options())
    flight.fly(3.0)
    bench = flight.bench
    bench.run(0.3, None)
    assert bench.state is State.LAND
    own = bench.position
    bench.position = (1.0, 0.0, 0.9)
    bench.run(0.02 * frames, None)
    bench.position = own
    assert bench.run(0.02, None).state is State.LAND
    bench.position = (1.0, 0.0, 0.9)
    bench.run(0.4, None)
    assert bench.state is State.DESCEND
    bench.position = own
    bench.run(0.4, None)
    assert bench.state is State.DESCEND
