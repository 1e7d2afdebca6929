"""A pose that stands still while the thrust rises is found; one that moves, or a steady thrust, is not."""

import random

from hypothesis import given
from hypothesis import strategies as st

from rcopterx.transmitter_gateway.still_pose import STILL_M, StillPose

FRAME_S = 0.01
noises_m = st.floats(0.0, 4e-4)
seeds = st.integers(0, 1000)


def watched(heights_m: list[float], shares: list[float]) -> bool:
    """Whether a pose is found not to answer at any time."""
    still, found = StillPose(), False
    for number, (height_m, share) in enumerate(zip(heights_m, shares, strict=True)):
        still.own(height_m, share, number * FRAME_S)
        found = found or still.unanswered
    return found


def standing(frames: int, noise_m: float, seed: int) -> list[float]:
    noise = random.Random(seed)
    return [0.5 + noise.gauss(0.0, noise_m) for _ in range(frames)]


@given(noises_m, seeds, st.floats(1.4, 2.0))
def test_a_pose_that_stands_while_the_thrust_rises_is_found_within_half_a_second(
    noise_m: float, seed: int, highest: float
) -> None:
    heights_m = standing(150, noise_m, seed)
    assert watched(heights_m, [1.0] * 100 + [highest] * 50)


@given(noises_m, seeds, st.floats(0.8, 1.5))
def test_a_vehicle_that_hovers_still_under_a_steady_thrust_answers(
    noise_m: float, seed: int, share: float
) -> None:
    assert not watched(standing(1000, noise_m, seed), [share] * 1000)


@given(st.floats(0.9, 1.2), st.floats(0.0, 0.01))
def test_a_battery_that_sags_slowly_is_no_other_body(share: float, rise_per_s: float) -> None:
    shares = [share + rise_per_s * FRAME_S * number for number in range(3000)]
    assert not watched([0.5] * 3000, shares)


@given(st.floats(1.2, 2.0))
def test_a_vehicle_that_moves_answers_any_thrust(share: float) -> None:
    heights_m = [0.5 + 1.5 * STILL_M * (number // 3) for number in range(300)]
    assert not watched(heights_m, [1.0] * 100 + [share] * 200)


def test_it_begins_anew() -> None:
    still = StillPose()
    for number in range(100):
        still.own(0.5, 1.0 if number < 50 else 2.0, number * FRAME_S)
    assert still.unanswered
    still.begin()
    assert not still.unanswered
