"""Which motion of a body is believed, and the velocity that follows from it."""

import math

import numpy as np
import pytest
from pose_monitor_bench import BOX, CENTRE, QUIET, Watch

from rcopterx.radios.limits import SurveillanceLimits
from rcopterx.transmitter_gateway.pose_monitor import Judgement


def test_a_swapped_body_is_not_believed_and_brings_the_vehicle_down_for_good() -> None:
    watch = Watch()
    watch.step()
    swapped_s = watch.now_s
    elsewhere = (0.6, 0.0, 1.0)
    while watch.now_s < swapped_s + 0.29:
        assert not watch.step(elsewhere)
    assert watch.judge() == Judgement("own pose lost for 0.1 s", None)
    while watch.now_s < swapped_s + 0.32:
        watch.step(elsewhere)
    assert watch.judge().descend == "own pose jumped and did not come back"
    watch.step()
    assert watch.judge().descend == "own pose jumped and did not come back"
    watch.monitor.release()
    assert watch.judge() == QUIET


def test_a_short_swap_is_forgiven() -> None:
    watch = Watch()
    watch.step()
    for _ in range(15):
        watch.step((0.6, 0.0, 1.0))
    assert watch.step()
    watch.now_s += 0.09
    assert watch.judge() == QUIET
    assert watch.counters["pose jump"] == 15


def test_a_fast_vehicle_is_believed_after_a_short_occlusion() -> None:
    watch = Watch()
    for n in range(50):
        assert watch.step((0.012 * n, 0.0, 1.0))
    assert watch.step((0.012 * 49 + 0.012 * 25, 0.0, 1.0), 0.25)


@pytest.mark.parametrize(("jump_m", "believed"), [(0.12, True), (0.13, False)])
def test_believed_distance_is_jump_limit_plus_speed_limit_times_time(jump_m: float, believed: bool) -> None:
    watch = Watch()
    watch.step()
    assert watch.step((jump_m, 0.0, 1.0)) == believed


@pytest.mark.parametrize(
    ("unseen_s", "reach_m"), [(0.1, 0.35), (0.6, 0.45), (1.6, 0.65), (2.1, 0.75), (5.0, 0.75)]
)
def test_a_vehicle_that_is_not_seen_is_believed_to_drift_slowly_for_two_seconds(
    unseen_s: float, reach_m: float
) -> None:
    for distance_m, believed in ((reach_m - 0.01, True), (reach_m + 0.01, False)):
        watch = Watch()
        watch.step()
        assert watch.step((0.6 * distance_m, 0.8 * distance_m, 1.0), unseen_s) == believed


@pytest.mark.parametrize(("height_m", "believed"), [(0.6, True), (-0.1, True), (-0.62, False), (2.56, False)])
def test_a_vehicle_that_is_not_seen_is_believed_to_have_sunk(height_m: float, believed: bool) -> None:
    """After a second: 1.01 m by sinking, 0.35 m by its speed, 0.18 m by its drift."""
    watch = Watch()
    watch.step()
    assert watch.step((0.0, 0.0, height_m), 1.0) == believed


def test_a_vehicle_that_sinks_unseen_is_believed_to_be_as_far_beside_its_place_as_one_that_does_not() -> None:
    for distance_m, believed in ((0.52, True), (0.54, False)):
        watch = Watch()
        watch.step()
        assert watch.step((distance_m, 0.0, 0.5), 1.0) == believed


def test_a_vehicle_is_believed_to_have_moved_while_frames_did_not_arrive() -> None:
    """The motion capture saw the body meanwhile, so it confuses it with no other one."""
    for frames, believed in ((70, True), (40, False)):
        watch = Watch()
        watch.step((0.0, 0.0, 0.05))
        watch.frame += frames - 1
        assert watch.step((0.5, 0.0, 1.1), 0.7) == believed


def test_frames_that_arrive_late_are_judged_by_when_they_were_captured() -> None:
    watch = Watch()
    watch.step()
    watch.frame += 33
    assert watch.step((0.2, 0.0, 1.3), 0.05)


def test_a_vehicle_that_was_occluded_may_be_another_one_after_a_silence() -> None:
    watch = Watch()
    watch.step()
    assert not watch.step(None)
    watch.frame += 69
    assert not watch.step((0.6, 0.0, 1.0), 0.7)


def test_a_vehicle_may_be_another_one_after_a_stream_has_restarted() -> None:
    watch = Watch()
    watch.step()
    watch.epoch, watch.frame = 2, 500
    assert not watch.step((0.6, 0.0, 1.0), 0.7)


def test_a_silence_after_a_jump_does_not_bring_the_vehicle_down_for_good() -> None:
    watch = Watch()
    watch.step()
    assert not watch.step((0.6, 0.0, 1.0))
    assert not watch.step((0.6, 0.0, 1.0), 0.35)
    assert watch.step(CENTRE)
    assert watch.judge() == QUIET


def test_on_the_floor_and_without_a_jump_limit_any_position_is_believed() -> None:
    watch = Watch()
    watch.step()
    assert watch.step((3.0, 0.0, 0.0), airborne=False)
    assert watch.velocity() == (0, 0, 0)
    unlimited = Watch(SurveillanceLimits(maximum_jump_m=None))
    unlimited.step()
    assert unlimited.step((3.0, 0.0, 0.0))


# Velocity -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("jitter_s", [0.0, 0.008])
def test_velocity_follows_the_motion_whatever_the_arrival_times(jitter_s: float) -> None:
    watch = Watch()
    for n in range(60):
        watch.step((0.008 * n, -0.004 * n, 1.0), 0.01 + (jitter_s if n % 2 else -jitter_s))
    assert watch.velocity() == pytest.approx((0.8, -0.4, 0.0), abs=0.01)


def test_velocity_uses_arrival_times_without_a_period_and_across_epochs() -> None:
    watch = Watch()
    for n in range(60):
        watch.now_s += 0.01
        watch.frame += 7
        watch.pose((0.008 * n, 0.0, 1.0), period_s=None)
    assert watch.velocity() == pytest.approx((0.8, 0.0, 0.0), abs=0.01)
    watch.epoch, watch.frame = 2, 1
    watch.step((0.008 * 60, 0.0, 1.0))
    assert watch.velocity() == pytest.approx((0.8, 0.0, 0.0), abs=0.01)


def test_missing_frames_do_not_distort_the_velocity() -> None:
    watch = Watch()
    for n in range(0, 90, 3):
        watch.now_s += 0.03
        watch.frame += 3
        watch.pose((0.008 * n, 0.0, 1.0))
    assert watch.velocity() == pytest.approx((0.8, 0.0, 0.0), abs=0.01)


def test_velocity_filter_has_its_time_constant() -> None:
    watch = Watch()
    watch.step((0.0, 0.0, 1.0))
    for n in range(1, 6):
        watch.step((0.005 * n, 0.0, 1.0))
    assert watch.velocity()[0] == pytest.approx(0.5 * (1 - math.exp(-1)), rel=1e-6)


def test_marker_noise_of_0_3_mm_never_alarms_a_vehicle_hovering_near_the_fence() -> None:
    watch = Watch(SurveillanceLimits(fence=BOX))
    noise = np.random.default_rng(1).normal(0, 0.3e-3, (3000, 3))
    for x, y, z in noise:
        watch.step((1.49 + x, y, 1.99 + z))
        assert watch.judge() == QUIET
