"""Motion and plan of a tracked subject, from its poses."""

import math

import numpy as np
import pytest

from rcopterx.vicon_gateway.subject_motion import AVOIDED_S, FOLLOWED_S, SETTLING_S, STAGES, SubjectMotion

PERIOD_S = 0.02
SPEED_M_S = 0.5
FASTEST = (1.0, 1.0, 1.0, 2.5)


def show(subject: SubjectMotion, seconds: float, speed_m_s: float = 0.0, turn_rad_s: float = 0.0) -> None:
    """Show the subject for a time, moving along x and turning."""
    x, y, z, yaw_rad = subject.motion[0].tolist()
    for frame in range(1, round(seconds / PERIOD_S) + 1):
        place_m = np.array((x + speed_m_s * PERIOD_S * frame, y, z))
        subject.advance(PERIOD_S)
        subject.correct(place_m, math.remainder(yaw_rad + turn_rad_s * PERIOD_S * frame, math.tau))


def hide(subject: SubjectMotion, seconds: float) -> None:
    for _ in range(round(seconds / PERIOD_S)):
        subject.advance(PERIOD_S)


def followable(subject: SubjectMotion) -> bool:
    plan = subject.plan()
    return plan is not None and plan.followable


def test_a_subject_is_followed_once_it_has_been_seen_for_a_while() -> None:
    subject = SubjectMotion(FASTEST)
    assert subject.plan() is None
    show(subject, SETTLING_S - 0.1)
    assert subject.plan() is not None
    assert not followable(subject)
    show(subject, 0.2)
    assert followable(subject)


def test_a_steady_motion_goes_on_and_dies_out() -> None:
    subject = SubjectMotion(FASTEST)
    show(subject, 2.0, SPEED_M_S)
    plan = subject.plan()
    assert plan is not None
    way_m = plan.trajectory.position_m[:, 0] - plan.trajectory.position_m[0, 0]
    assert way_m[10] == pytest.approx(0.2 * SPEED_M_S, rel=0.05)
    assert 0.5 * SPEED_M_S < way_m[-1] < SPEED_M_S
    assert plan.trajectory.velocity_m_s[0, 0] == pytest.approx(SPEED_M_S, abs=0.01)


def test_a_heading_goes_on_beyond_half_a_turn() -> None:
    subject = SubjectMotion(FASTEST)
    show(subject, 3.0, turn_rad_s=2.0)
    plan = subject.plan()
    assert plan is not None
    assert plan.trajectory.yaw_rad[0] == pytest.approx(6.0, abs=0.02)
    assert plan.trajectory.yaw_rate_rad_s[0] == pytest.approx(2.0, abs=0.1)


def test_a_lost_subject_is_first_followed_then_avoided_then_forgotten() -> None:
    subject = SubjectMotion(FASTEST)
    show(subject, 1.0, SPEED_M_S)
    seen = subject.plan()
    hide(subject, FOLLOWED_S - 0.04)
    assert followable(subject)
    hide(subject, 0.1)
    plan = subject.plan()
    assert plan is not None
    assert seen is not None
    assert not plan.followable
    assert plan.margins_m[0] > seen.margins_m[0] + 0.02
    hide(subject, AVOIDED_S)
    assert subject.plan() is None
    show(subject, SETTLING_S - 0.1)
    assert not followable(subject)


def test_another_body_under_its_name_is_not_followed_at_once() -> None:
    subject = SubjectMotion(FASTEST)
    show(subject, 1.0)
    subject.advance(PERIOD_S)
    subject.correct(np.array((1.0, 0.0, 0.0)), 0.0)
    plan = subject.plan()
    assert plan is not None
    assert not plan.followable
    assert plan.trajectory.position_m[0] == pytest.approx((1.0, 0.0, 0.0))
    assert abs(plan.trajectory.velocity_m_s).max() == 0.0


def test_followers_get_what_they_can_fly_and_others_keep_from_where_the_subject_goes() -> None:
    subject = SubjectMotion((0.2, 0.2, 1.0, 1.0))
    show(subject, 2.0, SPEED_M_S)
    plan = subject.plan()
    assert plan is not None
    assert plan.nominal is not None
    assert plan.nominal.velocity_m_s[0, 0] == pytest.approx(0.2)
    assert plan.trajectory.velocity_m_s[0, 0] == pytest.approx(SPEED_M_S, abs=0.01)
    assert plan.nominal.position_m[0] == pytest.approx(plan.trajectory.position_m[0])
    assert len(plan.margins_m) == STAGES


def test_margins_grow_over_the_horizon() -> None:
    subject = SubjectMotion(FASTEST)
    show(subject, 1.0)
    plan = subject.plan()
    assert plan is not None
    assert plan.margins_m[0] < 0.001
    assert 0.03 < plan.margins_m[20] < 0.1
    assert (np.diff(plan.margins_m) >= 0.0).all()
