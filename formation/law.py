"""The formation law (6): a follower's reference from its leaders' plans and the offsets to them.

Plans are inertial trajectories, so the rotation of body velocities from the leader's to the follower's frame
(v_F = R(psi_F)^T R(psi_L) v_L, equations (6) and (7) of the paper) is complete once a controller turns the
reference into its own heading.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from msgspec import Struct

from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.columns import (
    ACCELERATION,
    POSITION,
    VELOCITY,
    YAW,
    YAW_ACCELERATION,
    YAW_RATE,
)
from rcopterx.control.references.paths import rest_to_rest
from rcopterx.control.references.trajectory import Trajectory, on_turn_of, whole_turns
from rcopterx.vehicles.state import Array, turned_about_z

OffsetFrame = Literal["inertial", "heading"]


class FormationOffset(Struct, frozen=True):
    """Desired relative state d_(L,F): its first four components."""

    position_m: Array  # offset from leader to follower, shape (3,)
    yaw_rad: float = 0.0  # delta psi, the follower's heading relative to the leader's
    frame: OffsetFrame = "inertial"
    """`inertial`: the offset is fixed in the room, as in the paper. `heading`: it turns with the leader."""


def _pose(offset: FormationOffset) -> Array:
    return np.append(offset.position_m, offset.yaw_rad)


@dataclass(frozen=True, slots=True)
class FollowedLeader:
    """One leader, and the offset to it, which may move smoothly from `start` to `target`.

    Its path is a quintic, from rest to rest, in the frame of the target.
    """

    leader: str
    target: FormationOffset
    weight: float = 1.0
    start: FormationOffset | None = None
    start_s: float = 0.0
    duration_s: float = 0.0

    def moves(self, time_s: float) -> bool:
        """Return whether the offset has not reached its target yet."""
        return self.start is not None and time_s < self.start_s + self.duration_s

    def offsets(self, time_s: float, period_s: float, stages: int) -> tuple[Array, Array, Array]:
        """Return x, y, z, yaw, their rates and accelerations from a time on; three arrays of shape (N, 4)."""
        target = _pose(self.target)
        if self.start is None or not self.moves(time_s):
            rest = np.zeros((stages, 4))
            return np.tile(target, (stages, 1)), rest, rest
        elapsed_s = time_s - self.start_s + period_s * np.arange(stages)
        s = np.clip(elapsed_s / self.duration_s, 0.0, 1.0)[:, None]
        return rest_to_rest(_pose(self.start), target, s, self.duration_s)

    def offset_at(self, time_s: float) -> FormationOffset:
        """Return the offset at one moment."""
        value = self.offsets(time_s, 1.0, 1)[0][0]
        return FormationOffset(value[:3], float(value[3]), self.target.frame)


class LeaderPlan(Struct, frozen=True):
    """A leader's plan on this vehicle's clock."""

    trajectory: Trajectory
    ahead_s: float
    """Fleet time from the first stage of the plan to the present of this vehicle; the plan's own delay
    compensation makes it negative for a plan of the same frame."""
    followable: bool = True  # whether the leader is in free flight
    nominal: Trajectory | None = None  # its stages if nothing above were disturbed; None where unknown
    margins_m: tuple[float, ...] = (0.0,)  # how much farther to keep from each stage, the last one after it

    def margins_at(self, ahead_s: float, period_s: float, stages: int) -> Array:
        """Return how much farther to keep, at stages as those of a resampled trajectory, shape (stages,)."""
        at = (ahead_s + period_s * np.arange(stages)) / self.trajectory.period_s
        return np.asarray(np.interp(at, np.arange(len(self.margins_m)), self.margins_m))

    def partly_undisturbed(self, share: float) -> Trajectory:
        """Return the nominal trajectory, where it is known, with a share of the plan's deviation from it."""
        if self.nominal is None or share == 1.0:
            return self.trajectory
        nominal = self.nominal.samples
        return Trajectory(nominal + share * (self.trajectory.samples - nominal), self.trajectory.period_s)


class References(NamedTuple):
    """References of one control period."""

    flown: Trajectory  # what the vehicle flies
    nominal: Trajectory  # the same without disturbances above: set points of the head with all offsets


def references_beside(
    links: Sequence[FollowedLeader],
    plans: Mapping[str, LeaderPlan],
    deviation_share: float,
    yaw_rad: float,
    time_s: float,
    delay_s: float,
    period_s: float,
    stages: int,
) -> References:
    """Return references beside leaders, `stages` from `time_s + delay_s` on, next to the heading `yaw_rad`.

    `deviation_share` is the copied share of the leaders' deviations from their nominal references.
    """
    begin_s, weights = time_s + delay_s, [link.weight for link in links]

    def beside(leaders: Iterable[Trajectory], yaw_rad: float) -> Trajectory:
        references = []
        for link, leader in zip(links, leaders, strict=True):
            ahead_s = plans[link.leader].ahead_s + delay_s
            reference = follower_reference(leader, link, begin_s, ahead_s, period_s, stages)
            references.append(on_turn_of(reference, yaw_rad))
        return combined_reference(references, weights)

    followed = [plans[link.leader] for link in links]
    flown = beside((plan.partly_undisturbed(deviation_share) for plan in followed), yaw_rad)
    undisturbed = (plan.trajectory if plan.nominal is None else plan.nominal for plan in followed)
    return References(flown, beside(undisturbed, float(flown.samples[0, YAW])))


def follower_reference(
    plan: Trajectory, link: FollowedLeader, time_s: float, ahead_s: float, period_s: float, stages: int
) -> Trajectory:
    """Return the reference (6) of a follower from a time on: the leader's plan with the offset.

    It has the velocity and acceleration that a turning or moving offset brings. `ahead_s` is the time from
    the first stage of the plan to the first stage of the reference: zero for equal frames and equal delays,
    one period for a plan that is one period old.
    """
    target = link.target
    if target.frame == "inertial" and not link.moves(time_s):
        return plan.displaced(ahead_s, period_s, stages, target.position_m, target.yaw_rad)
    reference = plan.resampled(ahead_s, period_s, stages)
    samples = reference.samples.copy()
    value, rate, acceleration = link.offsets(time_s, period_s, stages)
    if target.frame == "heading":
        value, rate, acceleration = _carried_round(reference, value, rate, acceleration)
    for columns, yaw_column, added in (
        (POSITION, YAW, value),
        (VELOCITY, YAW_RATE, rate),
        (ACCELERATION, YAW_ACCELERATION, acceleration),
    ):
        samples[:, columns] += added[:, :3]
        samples[:, yaw_column] += added[:, 3]
    return Trajectory(samples, period_s)


def _carried_round(
    leader: Trajectory, value: Array, rate: Array, acceleration: Array
) -> tuple[Array, Array, Array]:
    """Offset in the leader's heading frame as seen in the room: centripetal, Euler and Coriolis terms."""
    c, s = np.cos(leader.yaw_rad), np.sin(leader.yaw_rad)

    def turned(offset: Array) -> Array:
        x, y = offset[:, 0], offset[:, 1]
        return np.column_stack((c * x - s * y, s * x + c * y, offset[:, 2:]))

    def across(offset: Array, by: Array) -> Array:
        return np.column_stack((-by * offset[:, 1], by * offset[:, 0], np.zeros((len(by), 2))))

    spin, spin_up = leader.yaw_rate_rad_s, leader.yaw_acceleration_rad_s2
    arm, moving = turned(value), turned(rate)
    return (
        arm,
        moving + across(arm, spin),
        turned(acceleration)
        + 2 * across(moving, spin)
        + across(arm, spin_up)
        + across(across(arm, spin), spin),
    )


def combined_reference(references: Sequence[Trajectory], weights: Sequence[float]) -> Trajectory:
    """Return the weighted mean of references of equal stages; it has the minimum of their weighted costs."""
    if len(references) == 1:
        return references[0]
    shares = np.asarray(weights) / np.sum(weights)
    samples = np.einsum("i,ijk->jk", shares, np.stack([reference.samples for reference in references]))
    return Trajectory(samples, references[0].period_s)


def offset_between(leader: Trajectory, estimate: Estimate, like: FormationOffset) -> FormationOffset:
    """Return the present offset from a leader, in the frame of another offset."""
    gap = estimate.motion[:3] - leader.position_m[0]
    yaw = float(leader.yaw_rad[0])
    if like.frame == "heading":
        gap = turned_about_z(gap, -yaw)
    yaw_gap = float(estimate.motion[YAW]) - yaw - like.yaw_rad
    yaw_rad = like.yaw_rad + yaw_gap - math.tau * whole_turns(yaw_gap)
    return FormationOffset(gap, yaw_rad, like.frame)
