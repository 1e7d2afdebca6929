"""Which poses count, and what is judged from them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pose_monitor_bench import QUIET, Watch

from rcopterx.radios.limits import SurveillanceLimits
from rcopterx.transmitter_gateway.inputs import Position
from rcopterx.transmitter_gateway.pose_monitor import Judgement


def epoch_of(watch: Watch) -> int | None:
    newest = watch.monitor.newest
    return None if newest is None else newest.epoch


# Stuck poses ----------------------------------------------------------------------------------------


def flying_watch(**limits: bool) -> Watch:
    """A vehicle that stood at a height of 0.1 m and has flown up to 1 m."""
    watch = Watch(SurveillanceLimits(**limits))
    watch.step((0.0, 0.0, 0.1), airborne=False)
    for number in range(1, 46):
        assert watch.step((0.0, 0.0, 0.1 + 0.02 * number))
    return watch


def test_position_that_repeats_itself_in_the_air_is_not_seen() -> None:
    watch = flying_watch(trust_repeated_poses=False)
    stuck: Position = (0.0, 0.0, 1.0001)
    assert watch.step(stuck)
    for number in range(1, 40):
        assert not watch.step(stuck)
        assert watch.counters["repeated pose"] == number
        if number in (9, 11, 29, 31):
            judgement = watch.judge()
            assert (judgement.hold is not None) == (number in (11, 29))
            assert (judgement.descend is not None) == (number == 31)
    assert watch.step((0.0, 0.0, 1.0002))
    assert watch.judge() == QUIET


def test_vehicle_that_rests_on_the_floor_is_seen_although_its_position_repeats_itself() -> None:
    watch = Watch(SurveillanceLimits(trust_repeated_poses=False))
    for airborne in (False, True):
        for _ in range(50):
            assert watch.step((0.0, 0.0, 0.1), airborne=airborne)
    assert watch.judge() == QUIET


def test_repeated_positions_can_be_trusted() -> None:
    watch = flying_watch()
    assert all(watch.step((0.0, 0.0, 1.0)) for _ in range(50))
    assert watch.judge() == QUIET


# Tracking -------------------------------------------------------------------------------------------


def test_a_tracked_vehicle_gives_no_cause() -> None:
    watch = Watch()
    watch.step()
    assert watch.judge() == QUIET


def test_a_vehicle_never_seen_is_lost() -> None:
    assert Watch().judge() == Judgement(None, "own pose lost for 0.3 s")


@pytest.mark.parametrize("occluded", [True, False])
def test_lost_tracking_holds_after_100_ms_and_descends_after_300_ms(occluded: bool) -> None:
    watch = Watch()
    watch.step()
    seen_s = watch.now_s
    for age_s, expected in (
        (0.099, QUIET),
        (0.101, Judgement("own pose lost for 0.1 s", None)),
        (0.299, Judgement("own pose lost for 0.1 s", None)),
        (0.301, Judgement(None, "own pose lost for 0.3 s")),
    ):
        if occluded:
            assert not watch.step(None, seen_s + age_s - watch.now_s)
        watch.now_s = seen_s + age_s
        assert watch.judge() == expected
    assert watch.counters["occluded pose"] == (4 if occluded else 0)
    watch.step()
    assert watch.judge() == QUIET


@pytest.mark.parametrize(
    ("hold_s", "descend_s", "expected"),
    [
        (None, None, QUIET),
        (None, 0.3, Judgement(None, "own pose lost for 0.3 s")),
        (0.1, None, Judgement("own pose lost for 0.1 s", None)),
    ],
)
def test_tracking_limits_can_be_switched_off(
    hold_s: float | None, descend_s: float | None, expected: Judgement
) -> None:
    watch = Watch(SurveillanceLimits(tracking_hold_s=hold_s, tracking_descend_s=descend_s))
    watch.step()
    watch.now_s += 10
    assert watch.judge() == expected


def test_next_events_are_the_tracking_limits() -> None:
    watch = Watch()
    assert watch.monitor.next_event_s() == []
    watch.step()
    assert watch.monitor.next_event_s() == [watch.now_s + 0.1, watch.now_s + 0.3]


# Which poses count --------------------------------------------------------------------------------------


@pytest.mark.parametrize("position", [(math.nan, 0, 1), (0, math.inf, 1), (0, 0), (0, 0, 1, 0)], ids=str)
def test_malformed_poses_are_counted_and_not_used(position: Position) -> None:
    watch = Watch()
    assert not watch.step(position)
    assert watch.counters["malformed pose"] == 1
    assert watch.monitor.newest is None


def test_repeated_and_older_poses_do_not_refresh_the_tracking() -> None:
    watch = Watch()
    watch.frame = 100
    watch.step()
    watch.now_s += 0.2
    assert not watch.pose()
    watch.frame -= 1
    assert not watch.pose()
    watch.epoch, watch.frame = 0, 1000
    assert not watch.pose()
    assert watch.counters == {"old pose frame": 2, "pose of an older epoch": 1}
    assert watch.judge().hold is not None
    assert epoch_of(watch) == 1


def test_a_new_epoch_starts_a_new_frame_count() -> None:
    watch = Watch()
    watch.frame = 1000
    watch.step()
    watch.epoch, watch.frame = 2, 0
    assert watch.step()
    assert epoch_of(watch) == 2


def test_after_a_second_of_silence_any_epoch_is_a_beginning() -> None:
    watch = Watch()
    watch.epoch = 10**9
    watch.step()
    watch.epoch = 1
    assert not watch.step(seconds=1.0)
    assert watch.step(seconds=0.01)
    assert epoch_of(watch) == 1


def test_number_of_vehicles_is_limited() -> None:
    watch = Watch()
    for n in range(63):
        watch.pose(vehicle=f"other{n}")
    watch.step()
    assert not watch.pose(vehicle="one more")
    assert watch.counters["too many vehicles"] == 1
    assert watch.step()


# Distance and thrust time -----------------------------------------------------------------------------


def test_vehicles_too_close_hold_until_they_are_clearly_apart() -> None:
    watch = Watch()
    watch.step()
    for distance, close in ((0.31, False), (0.29, True), (0.34, True), (0.36, False), (0.34, False)):
        watch.step(vehicle="h1")
        watch.pose((0.0, distance, 1.0), vehicle="h2")
        expected = Judgement("h2 closer than 0.3 m" if close else None, None)
        assert watch.judge() == expected


def test_last_position_of_a_neighbour_counts_for_half_a_second() -> None:
    watch = Watch()
    watch.step()
    watch.pose((0.0, 0.2, 1.0), vehicle="h2")
    seen_s = watch.now_s
    while watch.now_s < seen_s + 0.485:
        watch.step()
    assert watch.judge().hold is not None
    watch.step(seconds=0.03)
    assert watch.judge() == QUIET


def test_neighbours_may_jump_and_vanish() -> None:
    watch = Watch()
    watch.step()
    assert watch.pose((5.0, 5.0, 1.0), vehicle="h2")
    watch.frame += 1
    assert watch.pose((0.1, 0.0, 1.0), vehicle="h2")
    assert watch.judge().hold == "h2 closer than 0.3 m"
    watch.pose(None, vehicle="h3")
    assert watch.judge().hold == "h2 closer than 0.3 m"


def test_distance_check_can_be_switched_off() -> None:
    watch = Watch(SurveillanceLimits(minimum_distance_m=None))
    watch.step()
    watch.pose((0.0, 0.1, 1.0), vehicle="h2")
    assert watch.judge() == QUIET


def test_thrust_time_has_a_limit_if_asked_for() -> None:
    watch = Watch(SurveillanceLimits(maximum_thrust_s=300))
    watch.step()
    assert watch.judge(299.9) == QUIET
    assert watch.judge(300) == Judgement(None, "thrust for 300 s, the longest allowed")
    unlimited = Watch()
    unlimited.step()
    assert unlimited.judge(1e6) == QUIET


def test_limits_in_time_and_distance_met_exactly() -> None:
    limits = SurveillanceLimits(
        tracking_hold_s=0.125,
        tracking_descend_s=0.25,
        minimum_distance_m=0.25,
        other_pose_s=0.5,
        jump_descend_s=0.5,
        maximum_jump_m=0.125,
        maximum_speed_m_s=2.0,
    )
    watch = Watch(limits)
    watch.step()
    watch.pose((0.25, 0.0, 1.0), vehicle="h2")
    assert watch.judge() == QUIET
    watch.now_s += 0.25
    assert watch.judge() == Judgement(None, "own pose lost for 0.25 s")
    near = Watch(limits)
    near.pose((0.125, 0.0, 1.0), vehicle="h2")
    near.step(seconds=0.5)
    assert near.judge() == QUIET
    edge = Watch(limits)
    edge.step()
    assert edge.step((0.25, 0.0, 1.0), 0.0625)
    jumping = Watch(limits)
    jumping.step()
    for _ in range(9):
        assert jumping.judge().descend != "own pose jumped and did not come back"
        jumping.step((3.0, 0.0, 1.0), 0.0625)
    assert jumping.judge().descend == "own pose jumped and did not come back"


def test_pose_that_arrives_late_is_as_old_as_its_latency_says() -> None:
    watch = Watch()
    watch.step(latency_s=0.09)
    assert watch.judge() == QUIET
    watch.step(latency_s=0.11)
    assert watch.judge().hold == "own pose lost for 0.1 s"
    watch.step(latency_s=0.31)
    assert watch.judge().descend == "own pose lost for 0.3 s"


@pytest.mark.parametrize("latency_s", [-0.01, math.nan, math.inf])
def test_latency_that_makes_no_sense_is_refused(latency_s: float) -> None:
    watch = Watch()
    assert not watch.step(latency_s=latency_s)
    assert watch.counters == {"malformed pose": 1}


LANDS_AFTER = 30
"""Frames after which it lands; rounding decides about the last one."""


@pytest.mark.parametrize("turned_rad", [1.4, -2.4, math.pi])
def test_a_heading_that_jumps_holds_then_lands_the_vehicle_with_the_one_before(turned_rad: float) -> None:
    watch = Watch()
    watch.step(yaw_rad=3.0)
    for number in range(60):
        assert watch.step(yaw_rad=3.0 + turned_rad)
        motion = watch.monitor.own_motion(watch.now_s, 1.0)
        assert motion is not None
        assert motion.yaw_rad == 3.0
        assert watch.monitor.mistaken
        descends = "own heading jumped and did not come back" if number > LANDS_AFTER else None
        if number != LANDS_AFTER:
            assert watch.judge() == Judgement("own heading jumped", descends)
    watch.step(yaw_rad=3.1 - math.tau)
    assert watch.judge() == QUIET


@given(st.floats(-5.0, 5.0), st.sampled_from([0.01, 0.02, 0.1]), st.floats(-math.pi, math.pi))
def test_a_vehicle_that_turns_fast_has_no_jump(rate_rad_s: float, period_s: float, begins_rad: float) -> None:
    watch = Watch()
    for number in range(40):
        watch.step(seconds=period_s, yaw_rad=begins_rad + rate_rad_s * period_s * number)
        assert watch.judge() == QUIET


def test_a_vehicle_that_was_turned_on_the_floor_has_no_jump() -> None:
    watch = Watch()
    watch.step(airborne=False)
    watch.step(airborne=False, yaw_rad=math.pi)
    watch.step(yaw_rad=math.pi)
    assert watch.judge() == QUIET
