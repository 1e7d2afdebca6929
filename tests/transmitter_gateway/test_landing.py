"""Promises of the law that lands a vehicle by itself: towards its place, straight down, within its limits."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios.limits import LandingLimits, LimitsError
from rcopterx.transmitter_gateway.inputs import Position
from rcopterx.transmitter_gateway.landing import (
    CLIMB_CHANGE_M_S2,
    CLIMB_GAIN_PER_S,
    CLIMB_INTEGRAL_PER_S2,
    CUSHION_M,
    FALL_M_S,
    HURRY,
    LARGEST_ERROR_M,
    LARGEST_INTEGRAL_M_S2,
    LONGEST_STEP_S,
    POSITION_GAIN_PER_S2,
    VELOCITY_GAIN_PER_S,
    YAW_GAIN_PER_S,
    LandingLaw,
    Motion,
    climb_rate_m_s,
)

LIMITS = LandingLimits(input_gain=(2.0, 4.0, 10.0), yaw_rate_gain_rad_s=20.0)
HOVER = 0.5
STEP_S = 0.02
ORIGIN: Position = (0.0, 0.0, 1.0)
REST: Position = (0.0, 0.0, 0.0)

numbers = st.floats(-50, 50)
vectors = st.tuples(numbers, numbers, numbers)


def at(position: Position = ORIGIN, velocity: Position = REST, yaw_rad: float = 0.0) -> Motion:
    return Motion(position, velocity, yaw_rad)


def held(yaw_rad: float = 0.0) -> LandingLaw:
    """A law that holds the origin with this heading."""
    law = LandingLaw(LIMITS)
    law.step(at(yaw_rad=yaw_rad), 0.0, HOVER, STEP_S)
    return law


def test_at_rest_over_its_place_a_vehicle_hovers() -> None:
    assert held().step(at(), 0.0, HOVER, STEP_S) == (0.0, 0.0, HOVER, 0.0)


def test_first_step_takes_the_place_and_the_heading_of_the_moment() -> None:
    law = LandingLaw(LIMITS)
    assert law.step(at((3.0, -2.0, 1.0), yaw_rad=2.0), 0.0, HOVER, STEP_S) == (0.0, 0.0, HOVER, 0.0)
    assert law.step(at((3.1, -2.0, 1.0), yaw_rad=2.0), 0.0, HOVER, STEP_S)[0] != 0.0
    law.release()
    assert law.step(at((5.0, 1.0, 1.0), yaw_rad=-1.0), 0.0, HOVER, STEP_S) == (0.0, 0.0, HOVER, 0.0)


def test_a_place_that_is_clear_of_others_replaces_the_place_of_the_first_step() -> None:
    law = held(yaw_rad=0.5)
    moved = Motion(ORIGIN, REST, 0.5, clear_place_m=(0.1, 0.0, 1.0))
    away = law.step(moved, 0.0, HOVER, STEP_S)
    assert away[0] > 0.0
    assert away[3] == 0.0
    assert law.step(at(yaw_rad=0.5), 0.0, HOVER, STEP_S) == away


def test_sticks_point_back_to_the_place_along_the_heading_and_to_its_left() -> None:
    forward = POSITION_GAIN_PER_S2 * 0.1 / 2.0
    left = POSITION_GAIN_PER_S2 * 0.1 / 4.0
    assert held().step(at((-0.1, 0.0, 1.0)), 0.0, HOVER, STEP_S)[:2] == pytest.approx((forward, 0.0))
    assert held().step(at((0.0, -0.1, 1.0)), 0.0, HOVER, STEP_S)[:2] == pytest.approx((0.0, left))
    turned = held(math.pi / 2).step(at((-0.1, 0.0, 1.0), yaw_rad=math.pi / 2), 0.0, HOVER, STEP_S)
    assert turned[:2] == pytest.approx((0.0, -left))
    turned = held(math.pi / 2).step(at((0.0, -0.1, 1.0), yaw_rad=math.pi / 2), 0.0, HOVER, STEP_S)
    assert turned[:2] == pytest.approx((forward, 0.0))


def test_velocity_is_braked() -> None:
    braking = -VELOCITY_GAIN_PER_S * 0.2
    assert held().step(at(velocity=(0.2, 0.0, 0.0)), 0.0, HOVER, STEP_S)[:2] == pytest.approx(
        (braking / 2.0, 0.0)
    )
    assert held().step(at(velocity=(0.0, 0.2, 0.0)), 0.0, HOVER, STEP_S)[:2] == pytest.approx(
        (0.0, braking / 4.0)
    )


@pytest.mark.parametrize("distance", [1.5, 3.0, 10.0])
def test_place_that_is_far_is_approached_as_one_that_is_near(distance: float) -> None:
    far_m = distance * LARGEST_ERROR_M
    forward = POSITION_GAIN_PER_S2 * LARGEST_ERROR_M / 2.0
    assert held().step(at((-far_m, 0.0, 1.0)), 0.0, HOVER, STEP_S)[:2] == pytest.approx((forward, 0.0))
    left = held().step(at((0.0, -far_m, 1.0)), 0.0, HOVER, STEP_S)[:2]
    assert left == pytest.approx((0.0, forward / 2))


def test_heading_is_held_the_short_way_round() -> None:
    law = held(3.1)
    turned_rad = 0.2
    yaw = law.step(at(yaw_rad=3.1 + turned_rad - math.tau), 0.0, HOVER, STEP_S)[3]
    assert yaw == pytest.approx(-YAW_GAIN_PER_S * turned_rad / 20.0)


def test_climb_rate_that_is_asked_for_is_approached_steadily() -> None:
    law = held()
    change = CLIMB_CHANGE_M_S2 * STEP_S
    thrusts = [law.step(at(), -0.4, HOVER, STEP_S)[2] for _ in range(2)]
    integral = CLIMB_INTEGRAL_PER_S2 * STEP_S * change
    assert thrusts[0] == pytest.approx(HOVER - (CLIMB_GAIN_PER_S * change + integral) / 10.0)
    assert thrusts[1] == pytest.approx(HOVER - (CLIMB_GAIN_PER_S * 2 * change + 3 * integral) / 10.0)


def test_sinking_vehicle_gets_thrust_and_more_while_it_goes_on_sinking() -> None:
    law = held()
    first, second = (law.step(at(velocity=(0.0, 0.0, -0.1)), 0.0, HOVER, STEP_S)[2] for _ in range(2))
    step = CLIMB_INTEGRAL_PER_S2 * STEP_S * 0.1
    assert first == pytest.approx(HOVER + (CLIMB_GAIN_PER_S * 0.1 + step) / 10.0)
    assert second - first == pytest.approx(step / 10.0)


def test_pause_of_the_process_counts_as_one_step() -> None:
    paused, usual = held(), held()
    sinking = at(velocity=(0.0, 0.0, -0.1))
    assert paused.step(sinking, 0.0, HOVER, 5.0) == usual.step(sinking, 0.0, HOVER, LONGEST_STEP_S)


def test_integral_of_the_climb_rate_is_limited_and_forgotten_on_release() -> None:
    law = held()
    for _ in range(1000):
        law.step(at(velocity=(0.0, 0.0, -0.4)), 0.0, HOVER, STEP_S)
    assert law.step(at(), 0.0, HOVER, 0.0)[2] == pytest.approx(
        HOVER + min(LARGEST_INTEGRAL_M_S2 / 10.0, LIMITS.thrust)
    )
    weak = LandingLaw(LandingLimits(input_gain=(2.0, 4.0, 100.0)))
    weak.step(at(), 0.0, HOVER, STEP_S)
    for _ in range(2000):
        weak.step(at(velocity=(0.0, 0.0, -0.4)), 0.0, HOVER, STEP_S)
    assert weak.step(at(), 0.0, HOVER, 0.0)[2] == pytest.approx(HOVER + LARGEST_INTEGRAL_M_S2 / 100.0)
    law.release()
    assert law.step(at(), 0.0, HOVER, STEP_S)[2] == HOVER


def test_release_forgets_the_climb_rate() -> None:
    law = held()
    for _ in range(100):
        law.step(at(velocity=(0.0, 0.0, -0.4)), -0.4, HOVER, STEP_S)
    law.release()
    assert law.step(at(), 0.0, HOVER, 0.0)[2] == HOVER


def test_figures_of_the_law_are_those_it_was_flown_with() -> None:
    """Constants that other tests only compare with themselves."""
    assert held().step(at((-0.1, 0.0, 1.0)), 0.0, HOVER, STEP_S)[0] == pytest.approx(0.08)
    assert held().step(at((-9.0, 0.0, 1.0)), 0.0, HOVER, STEP_S)[0] == pytest.approx(0.24)
    assert held().step(at(velocity=(0.2, 0.0, 0.0)), 0.0, HOVER, STEP_S)[0] == pytest.approx(-0.2)
    assert held().step(at(yaw_rad=0.2), 0.0, HOVER, STEP_S)[3] == pytest.approx(-0.01)
    assert held().step(at(), -0.4, HOVER, STEP_S)[2] == pytest.approx(HOVER - 0.00202)
    assert held().step(at(velocity=(0.0, 0.0, -0.1)), 0.0, HOVER, 5.0)[2] == pytest.approx(HOVER + 0.0205)
    weak = LandingLaw(LandingLimits(input_gain=(2.0, 4.0, 100.0)))
    for _ in range(2000):
        weak.step(at(velocity=(0.0, 0.0, -0.4)), 0.0, HOVER, STEP_S)
    assert weak.step(at(), 0.0, HOVER, 0.0)[2] == pytest.approx(HOVER + 0.025)
    runaway = held()
    for n in range(100):
        step_at_speed(runaway, 0.02 * n)
    assert runaway.step(at(), -0.8, HOVER, STEP_S)[2] == pytest.approx(HOVER - 0.00606)
    assert climb_rate_m_s(at((0.0, 0.0, 0.41)), 0.0, 0.0, LIMITS, brakes=False) == -0.8
    assert climb_rate_m_s(at((0.0, 0.0, 0.40)), 0.0, 0.0, LIMITS, brakes=False) == -0.4


# A vehicle that does not obey -------------------------------------------------------------------------


def step_at_speed(law: LandingLaw, speed_m_s: float, seconds: float = STEP_S, yaw_rad: float = 0.0) -> float:
    """Pitch when the vehicle moves forwards at a speed; its position stays, for that is not the point."""
    velocity = (speed_m_s * math.cos(yaw_rad), speed_m_s * math.sin(yaw_rad), 0.0)
    return law.step(at(velocity=velocity, yaw_rad=yaw_rad), 0.0, HOVER, seconds)[0]


def run_away(law: LandingLaw, gain: float, yaw_rad: float = 0.0, begin_m_s: float = 0.1) -> list[float]:
    """Let pitch act on the speed with this share of its nominal gain, for two seconds."""
    speed_m_s, pitches = begin_m_s, []
    for _ in range(100):
        pitches.append(step_at_speed(law, speed_m_s, yaw_rad=yaw_rad))
        speed_m_s += gain * 2.0 * pitches[-1] * STEP_S
    return pitches


@pytest.mark.parametrize("yaw_rad", [0.0, 2.0])
def test_stick_that_acts_the_wrong_way_round_is_turned_round_and_the_vehicle_braked(yaw_rad: float) -> None:
    law = held(yaw_rad)
    pitches = run_away(law, -1.0, yaw_rad)
    assert law.obeyed
    assert min(pitches) < 0.0 < max(pitches)
    assert abs(pitches[-1]) < 0.2 * LIMITS.cyclic


def test_vehicle_that_is_driven_away_by_something_else_is_left_level() -> None:
    law = held()
    for n in range(100):
        pitch = step_at_speed(law, 0.02 * n)
    assert not law.obeyed
    assert pitch == 0.0


def speeds(law: LandingLaw, *speeds_m_s: float) -> bool:
    """Whether a vehicle brakes that has moved at these speeds for a step each."""
    for speed_m_s in speeds_m_s:
        step_at_speed(law, speed_m_s)
    return law.brakes


def test_vehicle_that_has_become_faster_for_a_tenth_of_a_second_is_not_waited_for() -> None:
    law = held()
    assert speeds(law, *10 * [0.39])
    assert speeds(law, *5 * [0.41])
    assert speeds(law, 0.1, *5 * [0.5])
    assert not speeds(law, 0.5)
    assert law.obeyed
    assert not speeds(law, 0.0)
    law.release()
    assert not law.brakes
    law.renew()
    assert law.brakes


def test_climb_rate_of_a_vehicle_that_has_become_faster_changes_faster() -> None:
    braked, faster = held(), held()
    for _ in range(10):
        step_at_speed(braked, 0.39)
        step_at_speed(faster, 0.41)
    assert (braked.brakes, faster.brakes) == (True, False)
    thrusts = [law.step(at(), -0.8, HOVER, STEP_S)[2] for law in (braked, faster)]
    assert thrusts[1] - HOVER == pytest.approx(3.0 * (thrusts[0] - HOVER))


def test_stick_is_turned_round_once_only() -> None:
    law = held()
    run_away(law, -1.0)
    assert law.obeyed
    assert run_away(law, 1.0, begin_m_s=0.3)[-1] == 0.0
    assert not law.obeyed
    law.renew()
    law.step(at(), 0.0, HOVER, STEP_S)
    assert step_at_speed(law, 0.2) < 0.0


def test_what_a_stick_does_is_not_forgotten_while_the_vehicle_is_not_seen() -> None:
    law = held()
    run_away(law, -1.0)
    law.release()
    law.step(at(), 0.0, HOVER, STEP_S)
    assert step_at_speed(law, 0.2) > 0.0
    assert abs(run_away(law, -1.0, begin_m_s=0.3)[-1]) < 0.2 * LIMITS.cyclic
    assert law.obeyed


def test_speed_that_was_gained_while_the_vehicle_was_not_seen_is_not_a_sticks() -> None:
    law = held()
    for _ in range(20):
        step_at_speed(law, 0.3)
    law.release()
    for _ in range(20):
        step_at_speed(law, 1.5)
    assert law.obeyed
    assert step_at_speed(law, 1.5) < 0.0


def test_vehicle_that_obeys_is_not_suspected() -> None:
    for gain in (0.5, 1.0, 1.5):
        law = LandingLaw(LIMITS)
        pitches = run_away(law, gain, begin_m_s=1.5)
        assert law.obeyed
        assert max(pitches) <= 0.05 * LIMITS.cyclic


@pytest.mark.parametrize(
    ("gained_m_s", "seconds", "obeyed"), [(0.39, 1.0, True), (0.41, 0.19, True), (0.41, 0.23, False)]
)
def test_vehicle_does_not_obey_once_it_has_gained_speed_for_some_time(
    gained_m_s: float, seconds: float, obeyed: bool
) -> None:
    law = held()
    for _ in range(round(seconds / 0.01)):
        step_at_speed(law, gained_m_s, 0.01)
    assert law.obeyed == obeyed


def test_speed_that_is_gained_for_a_moment_is_forgotten() -> None:
    law = held()
    for _ in range(10):
        for speed_m_s in (*[0.6] * 15, 0.1):
            step_at_speed(law, speed_m_s, 0.01)
    assert law.obeyed


def test_stick_without_effect_is_left_at_rest_and_the_other_one_goes_on() -> None:
    law = LandingLaw(LandingLimits(input_gain=(2.0, 2.0, 10.0)))
    for n in range(100):
        moving = at(velocity=(1.0, max(0.0, 1.0 - 0.02 * n), 0.0))
        pitch = law.step(moving, 0.0, HOVER, STEP_S)[0]
    assert not law.obeyed
    assert pitch == 0.0
    assert law.step(at(velocity=(1.0, 0.2, 0.0)), 0.0, HOVER, STEP_S)[1] < 0.0


@given(st.lists(st.tuples(vectors, vectors, numbers, st.floats(-1, 1), st.floats(0, 10)), max_size=20))
def test_inputs_stay_within_the_limits_whatever_happens(
    steps: list[tuple[Position, Position, float, float, float]],
) -> None:
    law = LandingLaw(LIMITS)
    fastest_m_s = 0.0
    for position, velocity, yaw_rad, climb_m_s, elapsed_s in steps:
        fastest_m_s = max(fastest_m_s, climb_m_s)
        pitch, roll, thrust, yaw = law.step(Motion(position, velocity, yaw_rad), climb_m_s, HOVER, elapsed_s)
        assert max(abs(pitch), abs(roll)) <= LIMITS.cyclic
        assert thrust - HOVER >= -LIMITS.thrust - 1e-12
        assert thrust - HOVER <= LIMITS.thrust + 1e-12 or velocity[2] < fastest_m_s - FALL_M_S
        assert abs(yaw) <= LIMITS.yaw


def test_a_fall_is_braked_with_more_thrust_than_any_other_motion() -> None:
    assert held().step(at(velocity=(0.0, 0.0, -2.0)), 0.0, HOVER, STEP_S)[2] > HOVER + 1.5 * LIMITS.thrust
    assert held().step(at(velocity=(0.0, 0.0, 2.0)), 0.0, HOVER, STEP_S)[2] == HOVER - LIMITS.thrust


# Climb rate of a landing ------------------------------------------------------------------------------


def rate(height_m: float = 1.0, speed: tuple[float, float] = (0.0, 0.0), landing_s: float = 0.0) -> float:
    floor_m = 0.25
    return climb_rate_m_s(at((5.0, 5.0, floor_m + height_m), (*speed, -3.0)), floor_m, landing_s, LIMITS)


def test_landing_descends_and_is_slower_above_the_floor() -> None:
    assert rate() == -LIMITS.descent_m_s
    assert rate(height_m=LIMITS.flare_m) == -LIMITS.descent_m_s
    assert rate(height_m=LIMITS.flare_m - 0.01) == -LIMITS.touchdown_m_s
    assert rate(height_m=CUSHION_M + 0.01) == -LIMITS.touchdown_m_s
    assert rate(height_m=CUSHION_M) == -LIMITS.descent_m_s


@pytest.mark.parametrize("speed", [(0.31, 0.0), (0.0, -0.31), (0.22, 0.22)])
def test_descent_waits_until_the_vehicle_has_braked_but_not_for_ever(speed: tuple[float, float]) -> None:
    assert rate(speed=speed) == 0.0
    assert rate(speed=speed, landing_s=LIMITS.braking_s - 0.01) == 0.0
    assert rate(speed=speed, landing_s=LIMITS.braking_s) == -LIMITS.descent_m_s
    assert rate(speed=(0.3, 0.0)) == -LIMITS.descent_m_s


def test_vehicle_that_does_not_obey_is_not_waited_for_and_comes_down_faster() -> None:
    motion = at((5.0, 5.0, 1.0), (1.0, 0.0, -0.5))
    assert climb_rate_m_s(motion, 0.0, 0.0, LIMITS, brakes=False) == -HURRY * LIMITS.descent_m_s
    for height_m, climb_m_s in (
        (HURRY * LIMITS.flare_m, -LIMITS.descent_m_s),
        (LIMITS.flare_m - 0.01, -LIMITS.touchdown_m_s),
    ):
        motion = at((5.0, 5.0, height_m), (1.0, 0.0, -0.5))
        assert climb_rate_m_s(motion, 0.0, 0.0, LIMITS, brakes=False) == climb_m_s


@pytest.mark.parametrize("field", ["cyclic", "thrust", "descent_m_s", "longest_s", "pose_age_s"])
def test_limits_that_make_no_sense_are_refused(field: str) -> None:
    with pytest.raises(LimitsError, match=f"landing.{field}: 0.0 must be a positive number"):
        LandingLimits(**{field: 0.0})  # type: ignore[arg-type]  # test data
    with pytest.raises(LimitsError, match=r"landing\.input_gain"):
        LandingLimits(input_gain=(2.0, -2.0, 18.0))
