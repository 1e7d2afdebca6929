"""The formation law: rotation sign, frames, time shifts, several leaders."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.control.references.columns import COLUMNS
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.formation.law import (
    FollowedLeader,
    FormationOffset,
    combined_reference,
    follower_reference,
)
from rcopterx.vehicles.state import Array, heading_matrix

PERIOD_S = 0.02
HEADINGS = [0.0, np.pi / 2, np.pi, -1.1]
angle = st.floats(-10, 10)


def along_x(heading: float, speed_m_s: float = 0.4, stages: int = 20) -> Trajectory:
    """Leader that flies along +x_I and looks anywhere."""
    samples = hold(np.array([0.1, -0.2, 1.0]), heading, PERIOD_S, stages).samples.copy()
    samples[:, 0] += speed_m_s * PERIOD_S * np.arange(stages)
    samples[:, 4] = speed_m_s
    return Trajectory(samples, PERIOD_S)


def moving(start: FormationOffset, target: FormationOffset, duration_s: float) -> FollowedLeader:
    """An offset whose transition begins 0.2 s after the first stage."""
    return FollowedLeader("h1", target, 1.0, start, 0.2, duration_s)


def beside(
    plan: Trajectory, offset: FormationOffset | FollowedLeader, ahead_s: float, period_s: float, stages: int
) -> Trajectory:
    link = offset if isinstance(offset, FollowedLeader) else FollowedLeader("h1", offset)
    return follower_reference(plan, link, 0.0, ahead_s, period_s, stages)


def turning(stages: int = 400, period_s: float = 0.005) -> Trajectory:
    """Leader on a curved path whose heading accelerates, with exact derivatives."""
    t = period_s * np.arange(stages)
    samples = np.zeros((stages, COLUMNS))
    samples[:, 0], samples[:, 4], samples[:, 8] = np.sin(t), np.cos(t), -np.sin(t)
    samples[:, 1], samples[:, 5], samples[:, 9] = 0.3 * t**2, 0.6 * t, 0.6
    samples[:, 2], samples[:, 6] = 1.0 + 0.1 * t, 0.1
    samples[:, 3], samples[:, 7], samples[:, 11] = t + 0.4 * t**2, 1 + 0.8 * t, 0.8
    return Trajectory(samples, period_s)


@pytest.mark.parametrize("leader_heading", HEADINGS)
@pytest.mark.parametrize("offset_yaw", HEADINGS)
@pytest.mark.parametrize("frame", ["inertial", "heading"])
def test_leader_flying_along_x_makes_followers_fly_along_x(
    leader_heading: float, offset_yaw: float, frame: str
) -> None:
    offset = FormationOffset(np.array([0.5, 0.2, 0.1]), offset_yaw, frame)  # type: ignore[arg-type]  # parametrized literal
    leader = along_x(leader_heading)
    reference = beside(leader, offset, 0.0, PERIOD_S, 20)
    assert reference.velocity_m_s == pytest.approx(leader.velocity_m_s)
    assert reference.yaw_rad == pytest.approx(leader_heading + offset_yaw)
    # body velocities, as a controller turns them: v_F = R(psi_F)' R(psi_L) v_L,body
    leader_body = heading_matrix(leader_heading).T @ leader.velocity_m_s[0, :2]
    phi = leader_heading - reference.yaw_rad[0]
    follower_body = heading_matrix(float(reference.yaw_rad[0])).T @ reference.velocity_m_s[0, :2]
    assert follower_body == pytest.approx(heading_matrix(float(phi)) @ leader_body)


@pytest.mark.parametrize("heading", HEADINGS)
def test_offset_is_fixed_in_the_room_or_to_the_leader(heading: float) -> None:
    leader = along_x(heading)
    d = np.array([0.5, 0.2, 0.1])
    fixed = beside(leader, FormationOffset(d), 0.0, PERIOD_S, 20)
    assert fixed.position_m - leader.position_m == pytest.approx(np.tile(d, (20, 1)))
    carried = beside(leader, FormationOffset(d, 0.0, "heading"), 0.0, PERIOD_S, 20)
    gap = (carried.position_m - leader.position_m)[0]
    assert heading_matrix(heading).T @ gap[:2] == pytest.approx(d[:2])
    assert gap[2] == pytest.approx(d[2])


@pytest.mark.parametrize("frame", ["inertial", "heading"])
@pytest.mark.parametrize("moves", [False, True])
def test_velocity_and_acceleration_are_the_derivatives_of_the_position(frame: str, moves: bool) -> None:
    leader = turning()
    target = FormationOffset(np.array([0.6, -0.3, 0.2]), 0.5, frame)  # type: ignore[arg-type]  # parametrized literal
    start = FormationOffset(np.array([-0.1, 0.2, 0.0]), -1.0)
    offset = moving(start, target, 1.9) if moves else target
    reference = beside(leader, offset, 0.0, leader.period_s, len(leader.samples))
    # the jerk of the transition jumps at its beginning, which central differences smear
    for values, rates in ((slice(0, 4), slice(4, 8)), (slice(4, 8), slice(8, 12))):
        central = (reference.samples[2:, values] - reference.samples[:-2, values]) / (2 * leader.period_s)
        assert central == pytest.approx(reference.samples[1:-1, rates], abs=0.02 if moves else 2e-4)


def test_an_offset_in_transition_starts_where_it_was_and_ends_at_its_target() -> None:
    leader = along_x(0.3, stages=120)
    start, target = FormationOffset(np.array([0.5, 0, 0]), 0.2), FormationOffset(np.array([0, 0.4, 0.1]), 1.0)
    reference = beside(leader, moving(start, target, 1.0), 0.0, PERIOD_S, 120)
    before = beside(leader, start, 0.0, PERIOD_S, 120)
    after = beside(leader, target, 0.0, PERIOD_S, 120)
    assert reference.samples[:11] == pytest.approx(before.samples[:11])
    assert reference.samples[60:] == pytest.approx(after.samples[60:])


def test_a_turning_leader_swings_the_whole_formation() -> None:
    """A point turn carries a follower around the leader, and looking the same way."""
    samples = hold(np.array([0, 0, 1.0]), 0.0, PERIOD_S, 50).samples.copy()
    samples[:, 3] = np.pi / 2 * np.arange(50) / 49
    samples[:, 7] = np.pi / 2 / (49 * PERIOD_S)
    offset = FormationOffset(np.array([0.5, 0, 0]), 0.0, "heading")
    reference = beside(Trajectory(samples, PERIOD_S), offset, 0.0, PERIOD_S, 50)
    assert reference.position_m[0] == pytest.approx([0.5, 0, 1])
    assert reference.position_m[-1] == pytest.approx([0, 0.5, 1], abs=1e-12)
    assert np.linalg.norm(reference.velocity_m_s, axis=1) == pytest.approx(0.5 * samples[0, 7])


def test_plan_of_an_earlier_frame_is_read_from_where_it_is_now() -> None:
    leader = turning()
    reference = beside(leader, FormationOffset(np.zeros(3)), 0.02, 0.02, 50)
    assert reference.samples == pytest.approx(leader.samples[4:204:4])
    between = beside(leader, FormationOffset(np.zeros(3)), 0.0175, 0.02, 50)
    middle = 0.5 * (leader.samples[3:203:4] + leader.samples[4:204:4])
    assert between.samples == pytest.approx(middle)


def test_end_of_a_shifted_plan_goes_on_with_its_last_velocity() -> None:
    leader = along_x(0.3)
    reference = beside(leader, FormationOffset(np.zeros(3)), 5 * PERIOD_S, PERIOD_S, 20)
    assert reference.position_m[-1, 0] == pytest.approx(0.1 + 0.4 * PERIOD_S * 24)
    assert reference.velocity_m_s[-1] == pytest.approx([0.4, 0, 0])


@given(st.lists(st.floats(0.1, 10), min_size=1, max_size=4), st.floats(0.1, 20))
def test_several_leaders_count_by_the_ratio_of_their_weights(weights: list[float], scale: float) -> None:
    references = [hold(np.array([i, -i, 1.0]), 0.1 * i, PERIOD_S, 3) for i in range(len(weights))]
    mean = combined_reference(references, weights)
    expected = sum(w * r.samples for w, r in zip(weights, references, strict=True)) / sum(weights)
    assert mean.samples == pytest.approx(expected)
    assert combined_reference(references, [scale * w for w in weights]).samples == pytest.approx(expected)


def test_equal_leaders_with_consistent_offsets_agree_with_one() -> None:
    first, second = along_x(0.4), along_x(0.4)
    shifted = Trajectory(second.samples + np.pad([1.0, 0, 0], (0, 9)), PERIOD_S)
    references = [
        beside(first, FormationOffset(np.array([0.5, 0.5, 0])), 0.0, PERIOD_S, 20),
        beside(shifted, FormationOffset(np.array([-0.5, 0.5, 0])), 0.0, PERIOD_S, 20),
    ]
    assert combined_reference(references, [1.0, 3.0]).samples == pytest.approx(references[0].samples)


@given(
    angle,
    angle,
    st.lists(st.floats(-1, 1), min_size=11, max_size=11),
    st.lists(st.floats(-1, 1), min_size=4, max_size=4),
)
def test_unscaled_plans_satisfy_equation_7_for_different_scalings(
    leader_yaw: float, delta_yaw: float, scaled: list[float], d: list[float]
) -> None:
    """(7) with two vehicles' own D and s gives the reference that plans in SI units give."""
    d_l, s_l = np.diag((1.2, 1.2, 1.0, 10.0, 1.1, 1.3, 1.0, 25.0, 1.0, 1.0, 1.0)), np.eye(11)[2]
    d_f, s_f = np.diag(np.arange(1.0, 12.0)), np.full(11, 0.3)
    state = d_l @ np.array(scaled) + s_l
    state[3] = leader_yaw
    offset = np.concatenate((d[:3], [delta_yaw], np.zeros(7)))
    omega = rotation(leader_yaw - (leader_yaw + delta_yaw))
    scaled_leader = np.linalg.solve(d_l, state - s_l)
    inverse = np.linalg.inv(d_f)
    by_equation_7 = inverse @ omega @ d_l @ scaled_leader + inverse @ offset + inverse @ (omega @ s_l - s_f)
    reference = beside(plan_of(state), FormationOffset(offset[:3], delta_yaw), 0.0, PERIOD_S, 1).samples[0]
    own = np.concatenate((reference[:8], state[8:]))
    own[4:6] = heading_matrix(reference[3]).T @ reference[4:6]
    assert (own - s_f) / np.diag(d_f) == pytest.approx(by_equation_7, abs=1e-9)


def rotation(phi: float) -> Array:
    """Omega(phi), 11 x 11, read so that v_F = R(psi_F)' R(psi_L) v_L."""
    omega = np.eye(11)
    omega[4:6, 4:6] = heading_matrix(phi)
    return omega


def plan_of(state: Array) -> Trajectory:
    samples = np.zeros((1, COLUMNS))
    samples[0, :8] = state[:8]
    samples[0, 4:6] = heading_matrix(state[3]) @ state[4:6]
    return Trajectory(samples, PERIOD_S)
