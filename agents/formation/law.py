"""The formation law (6): a follower's reference from its leaders' plans.

Plans are inertial trajectories, so the rotation of body velocities from the leader's to the follower's frame
(v_F = R(psi_F)^T R(psi_L) v_L, equations (6) and (7) of the paper) is complete once a controller turns the
reference into its own heading.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from msgspec import Struct

from rcopterx.control.references.quintic import rest_to_rest
from rcopterx.control.references.trajectory import (
    ACCELERATION,
    POSITION,
    VELOCITY,
    YAW,
    YAW_ACCELERATION,
    YAW_RATE,
    Trajectory,
)
from rcopterx.vehicles.state import Array

OffsetFrame = Literal["inertial", "heading"]


class FormationOffset(Struct, frozen=True):
    """Desired relative state d_(L,F): its first four components."""

    position_m: Array  # offset from leader to follower, shape (3,)
    yaw_rad: float = 0.0  # delta psi, the follower's heading relative to the leader's
    frame: OffsetFrame = "inertial"
    """`inertial`: the offset is fixed in the room, as in the paper. `heading`: it turns with the leader."""


class OffsetTransition(Struct, frozen=True):
    """Offset that moves smoothly (quintic, from rest to rest) between two values in the target's frame."""

    start: FormationOffset
    target: FormationOffset  # offsets before and after; only the target's frame counts
    elapsed_s: float  # since the transition's beginning at the reference's first stage; may be negative
    duration_s: float  # positive

    def sampled(self, period_s: float, stages: int) -> tuple[Array, Array, Array]:
        """Offset x, y, z, yaw, its rate and its acceleration at the stages; three arrays of shape (N, 4)."""
        s = np.clip((self.elapsed_s + period_s * np.arange(stages)) / self.duration_s, 0.0, 1.0)[:, None]
        return rest_to_rest(_pose(self.start), _pose(self.target), s, self.duration_s)


def follower_reference(
    plan: Trajectory, offset: FormationOffset | OffsetTransition, start_s: float, period_s: float, stages: int
) -> Trajectory:
    """Return the reference (6) of a follower: the leader's plan at the follower's stages, with the offset.

    It has the velocity and acceleration that a turning or moving offset brings. `start_s` is the time from
    the first stage of the plan to the first stage of the reference: zero for equal frames and equal delays,
    one period for a plan that is one period old.
    """
    if isinstance(offset, FormationOffset) and offset.frame == "inertial":
        return plan.displaced(start_s, period_s, stages, offset.position_m, offset.yaw_rad)
    reference = plan.resampled(start_s, period_s, stages)
    samples = reference.samples.copy()
    if isinstance(offset, OffsetTransition):
        frame = offset.target.frame
        value, rate, acceleration = offset.sampled(period_s, stages)
    else:
        frame = offset.frame
        value = np.tile(_pose(offset), (stages, 1))
        rate = acceleration = np.zeros((stages, 4))
    if frame == "heading":
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


def _pose(offset: FormationOffset) -> Array:
    return np.append(offset.position_m, offset.yaw_rad)


def combined_reference(references: Sequence[Trajectory], weights: Sequence[float]) -> Trajectory:
    """Return the weighted mean of references of equal stages; it has the minimum of their weighted costs."""
    if len(references) == 1:
        return references[0]
    shares = np.asarray(weights) / np.sum(weights)
    samples = np.einsum("i,ijk->jk", shares, np.stack([reference.samples for reference in references]))
    return Trajectory(samples, references[0].period_s)
