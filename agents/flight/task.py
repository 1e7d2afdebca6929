"""The task of a vehicle at one moment, and its leaders: their plans on its clock, and offsets to them."""

import math
from dataclasses import dataclass
from typing import Final

from msgspec import Struct

from rcopterx.agents.formation.law import FormationOffset, OffsetTransition
from rcopterx.agents.phases import Phase
from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.set_points import ReferenceSource
from rcopterx.control.references.trajectory import Trajectory, whole_turns
from rcopterx.vehicles.state import YAW, Array, turned_about_z

END_OF_TIME_S: Final = 1e9


class LeaderPlan(Struct, frozen=True):
    """A leader's plan on this vehicle's clock."""

    trajectory: Trajectory
    ahead_s: float
    """Fleet time from the first stage of the plan to the present of this vehicle; the plan's own delay
    compensation makes it negative for a plan of the same frame."""
    followable: bool = True  # whether the leader is in free flight
    nominal: Trajectory | None = None  # its stages if nothing above were disturbed; None where unknown

    def undisturbed(self) -> Trajectory:
        """Return the nominal trajectory, or the plan where that is unknown."""
        return self.trajectory if self.nominal is None else self.nominal

    def partly_undisturbed(self, share: float) -> Trajectory:
        """Return the nominal trajectory with a share of the plan's deviation from it."""
        if self.nominal is None or share == 1.0:
            return self.trajectory
        nominal = self.nominal.samples
        return Trajectory(nominal + share * (self.trajectory.samples - nominal), self.trajectory.period_s)


@dataclass(frozen=True, slots=True)
class FollowedLeader:
    """One leader, and the offset to it, which may move from `start` to `target`."""

    leader: str
    target: FormationOffset
    weight: float = 1.0
    start: FormationOffset | None = None
    start_s: float = 0.0
    duration_s: float = 0.0

    def course(self, time_s: float) -> FormationOffset | OffsetTransition:
        """Return the offset from a time on: at rest, or moving to the target."""
        if self.start is None or time_s >= self.start_s + self.duration_s:
            return self.target
        return OffsetTransition(self.start, self.target, time_s - self.start_s, self.duration_s)

    def offset_at(self, time_s: float) -> FormationOffset:
        """Return the offset at one moment."""
        course = self.course(time_s)
        if isinstance(course, FormationOffset):
            return course
        value = course.sampled(1.0, 1)[0][0]
        return FormationOffset(value[:3], float(value[3]), self.target.frame)


def offset_between(leader: Trajectory, estimate: Estimate, like: FormationOffset) -> FormationOffset:
    """Return the present offset from a leader, in the frame of another offset."""
    gap = estimate.motion[:3] - leader.position_m[0]
    yaw = float(leader.yaw_rad[0])
    if like.frame == "heading":
        gap = turned_about_z(gap, -yaw)
    yaw_gap = float(estimate.motion[YAW]) - yaw - like.yaw_rad
    yaw_rad = like.yaw_rad + yaw_gap - math.tau * whole_turns(yaw_gap)
    return FormationOffset(gap, yaw_rad, like.frame)


def end_of(source: ReferenceSource) -> tuple[Array, float]:
    """Return position [m], shape (3,), and yaw [rad] at which a reference ends."""
    end = source.sample(END_OF_TIME_S, 1.0, 2)
    return end.position_m[0], float(end.yaw_rad[0])


@dataclass(frozen=True, slots=True)
class Task:
    """What a vehicle has to do, and how far it is."""

    phase: Phase
    source: ReferenceSource  # own reference: a set point, a move or a path, and when it began
    followed: tuple[FollowedLeader, ...]  # leaders followed now, with transitions of their offsets
    assigned: tuple[FollowedLeader, ...]  # leaders by fleet file or request
    joined: frozenset[str]  # leaders whose offsets have begun to move from the vehicle's own place
    floor_m: float  # height of the floor below the vehicle when it took off
    interrupted: Phase | None = None  # phase that the gateway has interrupted, which resumes afterwards
