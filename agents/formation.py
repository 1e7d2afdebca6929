"""The formation law (6): a follower's reference from its leaders' plans.

Plans are inertial trajectories, so the rotation of body velocities from the leader's to the follower's frame
(v_F = R(psi_F)^T R(psi_L) v_L, control.md section 5) is complete once a controller turns the reference
into its own heading.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from agents.trajectory import ACCELERATION, POSITION, VELOCITY, YAW, Trajectory
from vehicles.state import Array

OffsetFrame = Literal["inertial", "heading"]


@dataclass(frozen=True, slots=True)
class FormationOffset:
    """Desired relative state d_(L,F): its first four components.

    Attributes
    ----------
    position_m
        Offset from leader to follower, shape (3,).
    yaw_rad
        Delta psi, the follower's heading relative to the leader's.
    frame
        `inertial`: the offset is fixed in the room, as in the paper. `heading`: it turns with the leader.
    """

    position_m: Array
    yaw_rad: float = 0.0
    frame: OffsetFrame = "inertial"

    def towards(self, target: "FormationOffset", fraction: float) -> "FormationOffset":
        """Offset on the way to another one in the target's frame; 0 is here, 1 is there."""
        position_m = (1 - fraction) * self.position_m + fraction * target.position_m
        yaw_rad = (1 - fraction) * self.yaw_rad + fraction * target.yaw_rad
        return FormationOffset(position_m, yaw_rad, target.frame)


def follower_reference(
    plan: Trajectory, offset: FormationOffset, start_s: float, period_s: float, stages: int
) -> Trajectory:
    """Reference (6) of a follower.

    Parameters
    ----------
    plan
        Leader's plan.
    offset
        d_(L,F).
    start_s
        Time from the first stage of the plan to the first stage of the reference: zero for equal frames and
        equal delays, one period for a plan that is one period old.
    period_s
        Follower's control period.
    stages
        Follower's horizon N.

    Returns
    -------
    Trajectory
        The plan, read at the follower's stages and displaced by the offset, with the velocity and the
        acceleration that a turning offset brings.
    """
    reference = plan.resampled(start_s, period_s, stages)
    samples = reference.samples.copy()
    leader_yaw = reference.yaw_rad
    if offset.frame == "inertial":
        samples[:, POSITION] += offset.position_m
    else:
        c, s = np.cos(leader_yaw), np.sin(leader_yaw)
        dx, dy, dz = offset.position_m
        arm = np.stack((c * dx - s * dy, s * dx + c * dy), axis=1)
        across = np.stack((-arm[:, 1], arm[:, 0]), axis=1)
        rate = reference.yaw_rate_rad_s[:, None]
        samples[:, 0:2] += arm
        samples[:, 2] += dz
        samples[:, VELOCITY][:, :2] += rate * across
        samples[:, ACCELERATION][:, :2] += reference.yaw_acceleration_rad_s2[:, None] * across - rate**2 * arm
    samples[:, YAW] += offset.yaw_rad
    return Trajectory(samples, period_s)


def combined_reference(references: Sequence[Trajectory], weights: Sequence[float]) -> Trajectory:
    """Reference of a follower of several leaders.

    Quadratic terms with weights that add up to one have the same minimum as one term around the weighted mean
    of the references, so the mean is all a controller needs.

    Parameters
    ----------
    references
        One per leader, equal stages and periods.
    weights
        Positive; only their ratios count.

    Returns
    -------
    Trajectory
        Weighted mean.
    """
    if len(references) == 1:
        return references[0]
    shares = np.asarray(weights) / np.sum(weights)
    samples = np.einsum("i,ijk->jk", shares, np.stack([reference.samples for reference in references]))
    return Trajectory(samples, references[0].period_s)
