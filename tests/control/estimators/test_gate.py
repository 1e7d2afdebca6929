"""Promises of the innovation gate for sudden poses that are near enough to have been flown to."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL

from rcopterx.control.estimators.base import ACCEPT, REJECT, SHIFT, InnovationGate, Verdict
from rcopterx.control.estimators.settings import EstimatorSettings

GOOD = np.array([0.001, -0.001, 0.001, 0.0])
FORWARD, UPWARD, DOWNWARD = (
    np.array(away) for away in ([0.05, 0.0, 0.0, 0.0], [0.0, 0.0, 0.05, 0.0], [0.0, 0.0, -0.05, 0.0])
)
DEVIATION = np.full(4, 0.001)


def judged(*innovations: np.ndarray, deviation: np.ndarray = DEVIATION) -> list[Verdict]:
    gate = InnovationGate(COAXIAL, EstimatorSettings())
    return [gate.judge(innovation, innovation, deviation) for innovation in innovations]


def test_a_single_pose_that_is_off_is_left_out() -> None:
    assert judged(GOOD, UPWARD, GOOD, UPWARD, GOOD) == [
        ACCEPT, REJECT, ACCEPT, REJECT, ACCEPT,
    ]  # fmt: skip


def test_two_that_agree_are_a_shift_of_what_is_measured() -> None:
    assert judged(GOOD, UPWARD, UPWARD + GOOD, GOOD) == [
        ACCEPT, REJECT, SHIFT, ACCEPT,
    ]  # fmt: skip


def test_those_that_do_not_agree_are_left_out_but_not_for_ever() -> None:
    found = judged(*([UPWARD, DOWNWARD, FORWARD] * 2))
    assert found == [REJECT] * 4 + [ACCEPT, REJECT]


@given(st.floats(-0.02, 0.02), st.floats(0.0, 0.1))
def test_what_noise_explains_is_not_sudden(away_m: float, deviation_m: float) -> None:
    innovation = np.array([away_m, 5.0 * deviation_m, 0.0, 0.3])
    assert judged(innovation, deviation=np.full(4, deviation_m)) == [ACCEPT]
