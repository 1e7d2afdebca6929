"""Motion and plan of a tracked subject, from its poses."""

import math

import numpy as np
import pytest

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.subjects.track import AVOIDED_S, FOLLOWED_S, SETTLING_S, STAGES, SubjectTrack
from rcopterx.control.interfaces import Measurement
from rcopterx.control.references.set_points import ProfileLimits

PERIOD_S = 0.02
SPEED_M_S = 0.5


def show(track: SubjectTrack, seconds: float, speed_m_s: float = 0.0, turn_rad_s: float = 0.0) -> None:
    """Show the subject for a time, moving along x and turning."""
    begin, (x, y, z, yaw_rad) = track.clock.frame, track.motion[0].tolist()
    for frame in range(1, round(seconds / PERIOD_S) + 1):
        place_m = np.array((x + speed_m_s * PERIOD_S * frame, y, z))
        turned_rad = math.remainder(yaw_rad + turn_rad_s * PERIOD_S * frame, math.tau)
        assert track.observe(StampedMeasurement(1, begin + frame, PERIOD_S, Measurement(place_m, turned_rad)))


def hide(track: SubjectTrack, seconds: float) -> None:
    begin = track.clock.frame
    for frame in range(1, round(seconds / PERIOD_S) + 1):
        track.observe(StampedMeasurement(1, begin + frame, PERIOD_S, None))


def followable(track: SubjectTrack) -> bool:
    plan = track.plan()
    return plan is not None and plan.followable


def test_a_subject_is_followed_once_it_has_been_seen_for_a_while() -> None:
    track = SubjectTrack()
    assert track.plan() is None
    show(track, SETTLING_S - 0.1)
    assert track.plan() is not None
    assert not followable(track)
    show(track, 0.2)
    assert followable(track)


def test_a_steady_motion_goes_on_and_dies_out() -> None:
    track = SubjectTrack()
    show(track, 2.0, SPEED_M_S)
    plan = track.plan()
    assert plan is not None
    way_m = plan.trajectory.position_m[:, 0] - plan.trajectory.position_m[0, 0]
    assert way_m[10] == pytest.approx(0.2 * SPEED_M_S, rel=0.05)
    assert 0.5 * SPEED_M_S < way_m[-1] < SPEED_M_S
    assert plan.trajectory.velocity_m_s[0, 0] == pytest.approx(SPEED_M_S, abs=0.01)


def test_a_heading_goes_on_beyond_half_a_turn() -> None:
    track = SubjectTrack()
    show(track, 3.0, turn_rad_s=2.0)
    plan = track.plan()
    assert plan is not None
    assert plan.trajectory.yaw_rad[0] == pytest.approx(6.0, abs=0.02)
    assert plan.trajectory.yaw_rate_rad_s[0] == pytest.approx(2.0, abs=0.1)


def test_a_lost_subject_is_first_followed_then_avoided_then_forgotten() -> None:
    track = SubjectTrack()
    show(track, 1.0, SPEED_M_S)
    seen = track.plan()
    hide(track, FOLLOWED_S - 0.04)
    assert followable(track)
    hide(track, 0.1)
    plan = track.plan()
    assert plan is not None
    assert seen is not None
    assert not plan.followable
    assert plan.margins_m[0] > seen.margins_m[0] + 0.02
    hide(track, AVOIDED_S)
    assert track.plan() is None
    show(track, SETTLING_S - 0.1)
    assert not followable(track)


def test_another_body_under_its_name_is_not_followed_at_once() -> None:
    track = SubjectTrack()
    show(track, 1.0)
    track.observe(
        StampedMeasurement(1, track.clock.frame + 1, PERIOD_S, Measurement(np.array((1.0, 0.0, 0.0)), 0.0))
    )
    plan = track.plan()
    assert plan is not None
    assert not plan.followable
    assert plan.trajectory.position_m[0] == pytest.approx((1.0, 0.0, 0.0))
    assert abs(plan.trajectory.velocity_m_s).max() == 0.0


def test_a_plan_stays_within_the_limits_and_others_keep_from_where_the_subject_may_be() -> None:
    free, limited = SubjectTrack(), SubjectTrack(ProfileLimits((0.2, 0.2, 1.0), (1.0, 1.0, 1.0), (1, 1, 1)))
    for track in (free, limited):
        show(track, 2.0, SPEED_M_S)
    plan, other = limited.plan(), free.plan()
    assert plan is not None
    assert other is not None
    assert plan.trajectory.velocity_m_s[0, 0] == pytest.approx(0.2)
    gap_m = other.trajectory.position_m[:, 0] - plan.trajectory.position_m[:, 0]
    added_m = np.subtract(plan.margins_m, other.margins_m)
    assert added_m[:20] == pytest.approx(gap_m[:20], abs=1e-9)
    assert len(plan.margins_m) == STAGES


def test_margins_grow_over_the_horizon() -> None:
    track = SubjectTrack()
    show(track, 1.0)
    plan = track.plan()
    assert plan is not None
    assert plan.margins_m[0] < 0.001
    assert 0.03 < plan.margins_m[20] < 0.1
    assert list(plan.margins_m) == sorted(plan.margins_m)


def test_an_old_frame_changes_nothing() -> None:
    track = SubjectTrack()
    show(track, 1.0, SPEED_M_S)
    before = track.motion.copy()
    assert not track.observe(StampedMeasurement(1, 3, PERIOD_S, Measurement(np.zeros(3), 0.0)))
    assert (track.motion == before).all()
