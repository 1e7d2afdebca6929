"""The box a vehicle must stay in."""

import pytest
from pose_monitor_bench import BOX, Watch

from rcopterx.radios.limits import Fence, LimitsError, SurveillanceLimits
from rcopterx.transmitter_gateway.inputs import Position
from rcopterx.transmitter_gateway.pose_monitor import Judgement, judge_fence


@pytest.mark.parametrize(
    ("position", "velocity", "hold", "descend"),
    [
        ((1.3, 0, 1), (0.89, 0, 0), None, None),
        ((1.3, 0, 1), (0.90, 0, 0), "cannot stop inside the fence in x", None),
        ((1.3, 0, 1), (-0.90, 0, 0), None, None),
        ((-1.3, 0, 1), (-0.90, 0, 0), "cannot stop inside the fence in x", None),
        ((-1.3, 0, 1), (-0.89, 0, 0), None, None),
        ((0, 1.3, 1), (0, 0.90, 0), "cannot stop inside the fence in y", None),
        ((0, -1.3, 1), (0, -0.90, 0), "cannot stop inside the fence in y", None),
        ((1.3, 1.3, 1), (0.9, 0.9, 0), "cannot stop inside the fence in x", None),
        ((0, 0, 1.8), (0, 0, 0.89), None, None),
        ((0, 0, 1.8), (0, 0, 0.90), None, "cannot stop below the fence's ceiling"),
        ((0, 0, 0.1), (0, 0, -2.0), None, None),
        ((1.55, 0, 1), (0, 0, 0), None, None),
        ((1.55, 0, 1), (-0.1, 0, 0), None, None),
        ((1.55, 0, 1), (0.01, 0, 0), "cannot stop inside the fence in x", None),
        ((1.59, 0, 1), (0, 0, 0), None, None),
        ((1.61, 0, 1), (0, 0, 0), None, "outside the fence in x"),
        ((0, -1.61, 1), (0, 0.5, 0), None, "outside the fence in y"),
        ((0, 0, 2.11), (0, 0, -1), None, "outside the fence in z"),
        ((0, 0, -0.09), (0, 0, 0), None, None),
        ((0, 0, -0.11), (0, 0, 0), None, "outside the fence in z"),
        ((1.55, 0, 2.2), (0.5, 0, 0), None, "outside the fence in z"),
    ],
)
def test_fence(position: Position, velocity: Position, hold: str | None, descend: str | None) -> None:
    assert judge_fence(BOX, position, velocity) == (hold, descend)


def test_fence_is_judged_from_the_poses() -> None:
    watch = Watch(SurveillanceLimits(fence=BOX))
    for n in range(100):
        watch.step((0.012 * n, 0.0, 1.0))
    assert watch.judge() == Judgement("cannot stop inside the fence in x", None)
    for n in range(100, 135):
        watch.step((0.012 * n, 0.0, 1.0))
    assert watch.judge() == Judgement(None, "outside the fence in x")


def test_fence_limits_met_exactly_are_still_inside() -> None:
    box = Fence((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0), margin_m=0.25)
    for position in ((1.25, 0, 1), (-1.25, 0, 1), (0, 0, 2.25), (0, 0, -0.25)):
        assert judge_fence(box, position, (0, 0, 0)) == (None, None)
    assert judge_fence(box, (0.75, 0, 1), (1.0, 0, 0)) == (None, None)
    assert judge_fence(box, (-0.75, 0, 1), (-1.0, 0, 0)) == (None, None)
    assert judge_fence(box, (0, 0, 1.75), (0, 0, 1.0)) == (None, None)
    assert judge_fence(box, (-1.125, 0, 1), (0.5, 0, 0)) == (None, None)


@pytest.mark.parametrize("axis", range(3))
def test_a_vehicle_has_left_when_it_is_further_outside_than_the_limit(axis: int) -> None:
    fence = Fence((-1.0, -2.0, 0.0), (1.0, 2.0, 3.0), cut_m=0.5)
    for edge_m, outwards in ((fence.lower_m[axis], -1), (fence.upper_m[axis], 1)):
        for outside_m, left in ((0.5, False), (0.51, True)):
            position = [0.0, 0.0, 1.0]
            position[axis] = edge_m + outwards * outside_m
            assert fence.left((position[0], position[1], position[2])) == left


@pytest.mark.parametrize("cut_m", [0.1, -1.0, float("nan"), float("inf")])
def test_a_limit_within_the_margin_is_refused(cut_m: float) -> None:
    with pytest.raises(LimitsError, match=r"fence\.cut_m"):
        Fence((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0), cut_m=cut_m)
