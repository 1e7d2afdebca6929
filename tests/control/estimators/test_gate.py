"""Promises of the innovation gate for sudden poses that are near enough to have been flown to."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL

from rcopterx.control.estimators.base import InnovationGate
from rcopterx.control.estimators.settings import EstimatorSettings

ACCEPT, REJECT = (True, None), (False, None)
GOOD = np.array([0.001, -0.001, 0.001, 0.0])
FORWARD, UPWARD, DOWNWARD = (
    np.array(away) for away in ([0.05, 0.0, 0.0, 0.0], [0.0, 0.0, 0.05, 0.0], [0.0, 0.0, -0.05, 0.0])
)
DEVIATION = np.full(4, 0.001)


def judged(
    *innovations: np.ndarray, deviation: np.ndarray = DEVIATION
) -> list[tuple[bool, np.ndarray | None]]:
    gate = InnovationGate(COAXIAL, EstimatorSettings())
    return [gate.judge(innovation, innovation, deviation) for innovation in innovations]


def test_a_single_pose_that_is_off_is_left_out() -> None:
    assert judged(GOOD, UPWARD, GOOD, UPWARD, GOOD) == [
        ACCEPT, REJECT, ACCEPT, REJECT, ACCEPT,
    ]  # fmt: skip


def test_two_that_agree_are_a_shift_of_what_is_measured() -> None:
    *before, shift, after = judged(GOOD, UPWARD, UPWARD + GOOD, GOOD)
    assert [*before, after] == [ACCEPT, REJECT, ACCEPT]
    accepted, offset = shift
    assert accepted
    assert offset is not None
    assert np.array_equal(offset, UPWARD + GOOD)


def test_those_that_do_not_agree_are_left_out_but_not_for_ever() -> None:
    found = judged(*([UPWARD, DOWNWARD, FORWARD] * 2))
    assert found == [REJECT] * 4 + [ACCEPT, REJECT]


@given(st.floats(-0.02, 0.02), st.floats(0.0, 0.1))
def test_what_noise_explains_is_not_sudden(away_m: float, deviation_m: float) -> None:
    innovation = np.array([away_m, 5.0 * deviation_m, 0.0, 0.3])
    assert judged(innovation, deviation=np.full(4, deviation_m)) == [ACCEPT]


def test_the_first_of_refused_poses_is_the_offset_of_those_after_it_until_they_are_believed() -> None:
    gate = InnovationGate(COAXIAL, EstimatorSettings(gate_limit_s=0.1))
    verdicts = []
    for number in range(6):
        gate.wait(0.02)
        pose = np.array([1.0 + 0.002 * number, 0.0, 0.0, 0.0])
        verdicts.append(gate.judge(pose, pose, DEVIATION))
    assert verdicts[0] == REJECT
    assert [accepted for accepted, _ in verdicts] == [False] * 5 + [True]
    offsets = [offset for _, offset in verdicts[1:] if offset is not None]
    assert np.array_equal(offsets, [[1.0, 0.0, 0.0, 0.0]] * 5)


@pytest.mark.parametrize(("waited_s", "accepted"), [(0.02, False), (0.2, False), (0.25, True)])
def test_gate_allows_for_what_a_prediction_without_poses_misses(waited_s: float, accepted: bool) -> None:
    gate = InnovationGate(COAXIAL, EstimatorSettings())
    gate.wait(waited_s)
    assert gate.judge(2.6 * DOWNWARD, 2.6 * DOWNWARD, np.zeros(4))[0] == accepted


def test_time_before_a_restart_allows_for_nothing() -> None:
    gate = InnovationGate(COAXIAL, EstimatorSettings())
    gate.wait(0.25)
    gate.open()
    assert gate.judge(2.6 * DOWNWARD, 2.6 * DOWNWARD, np.zeros(4)) == REJECT
