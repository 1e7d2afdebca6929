"""Messages of an agent about commands, plans and state."""

import math
from typing import Final

from rcopterx.agents.following.leader_plans import LeaderPlans
from rcopterx.agents.following.links import present_link, target_link
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.settings import AgentSettings
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import AgentStatus, Command, Diagnostics, LeaderLink, Plan, Pose, SetPoint
from rcopterx.bus.rounding import all_rounded, rounded
from rcopterx.bus.subscription import Received
from rcopterx.bus.timing import CommandTiming
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.vehicles.state import YAW, Array, heading_matrix
from rcopterx.vehicles.tuples import three

REFERENCE_BITS: Final = 14
"""References are rounded to a sixteenth of a millimetre."""


def command_message(
    settings: AgentSettings,
    pilot: Pilot,
    flight: ControlOutput,
    lease: int,
    timing: CommandTiming | None,
) -> Command:
    """Stick command of a control period."""
    pitch, roll, thrust, yaw = flight.input.tolist()
    return Command(
        epoch=pilot.clock.epoch,
        frame=pilot.clock.current_frame,
        lease=lease,
        sequence=pilot.sequence,
        input=(pitch, roll, thrust, yaw),
        next_inputs=FloatArray.of(flight.next_inputs),
        period_s=settings.period_s,
        timing=timing,
    )


def timing_of(
    settings: AgentSettings, pilot: Pilot, seen: Received[Pose] | None, began_s: float, ready_s: float
) -> CommandTiming | None:
    """Return the stages that a command has passed so far.

    None where the frame was predicted, and where hosts have no names. The controller began and had finished
    at `began_s` and `ready_s` [monotonic s]; `seen` is the newest pose.
    """
    if seen is None:
        return None
    pose, clock = seen.message, pilot.clock
    predicted = (pose.epoch, pose.frame) != (clock.epoch, clock.current_frame)
    if predicted or pose.host is None or not settings.bus.host:
        return None
    return CommandTiming(
        latency_s=pose.latency_s,
        gateway_host=pose.host,
        received_s=pose.received_s,
        agent_host=settings.bus.host,
        arrived_s=seen.arrived_s,
        began_s=began_s,
        ready_s=ready_s,
    )


def plan_message(settings: AgentSettings, pilot: Pilot, flight: ControlOutput, leaders: LeaderPlans) -> Plan:
    """Plan of a control period."""
    reference = None
    if flight.reference is not None:
        x, y, z, yaw = all_rounded(flight.reference.tolist(), REFERENCE_BITS)
        reference = (x, y, z, yaw)
    return Plan(
        epoch=pilot.clock.epoch,
        frame=pilot.clock.current_frame,
        source=settings.vehicle,
        ancestors=leaders.ancestors(pilot.guidance.leaders),
        period_s=flight.plan.period_s,
        start_s=flight.start_s,
        airborne=pilot.guidance.rotor_on,
        trajectory=TrajectoryArray.of(flight.plan.samples),
        reference=reference,
        following=_following(pilot) if pilot.guidance.follows else (),
        followable=pilot.guidance.followable,
    )


def _following(pilot: Pilot) -> tuple[LeaderLink, ...]:
    return tuple(present_link(link, pilot.clock.time_s) for link in pilot.guidance.followed)


def status_message(pilot: Pilot, following_mode: str, diagnostics: Diagnostics) -> AgentStatus:
    """Status of the vehicle."""
    position, yaw_rad = pilot.guidance.set_point()
    motion = pilot.estimate.motion if pilot.clock.started else None
    return AgentStatus(
        phase=pilot.guidance.phase.value,
        epoch=pilot.clock.epoch,
        frame=pilot.clock.current_frame,
        set_point=SetPoint(position_m=three(position), yaw_rad=yaw_rad),
        following=_following(pilot),
        assigned=tuple(target_link(link) for link in pilot.guidance.assigned),
        following_mode=following_mode,
        position_m=None if motion is None else three(motion[:3]),
        velocity_m_s=None if motion is None else _inertial_velocity(motion),
        yaw_rad=None if motion is None else float(motion[YAW]),
        error_m=_error_m(pilot),
        path_left_s=pilot.guidance.path_left_s(pilot.clock.time_s),
        excitation_left_s=pilot.exciter.left_s(pilot.clock.time_s),
        excitation=pilot.exciter.outcome,
        diagnostics=diagnostics,
    )


def _error_m(pilot: Pilot) -> float | None:
    """Distance of the plan's beginning from the reference [m]; None on the floor."""
    if pilot.plan is None or pilot.reference is None:
        return None
    return rounded(
        math.dist(pilot.plan.samples[0, :3].tolist(), pilot.reference[:3].tolist()), REFERENCE_BITS
    )


def _inertial_velocity(motion: Array) -> tuple[float, float, float]:
    x, y = (heading_matrix(float(motion[YAW])) @ motion[4:6]).tolist()
    return (x, y, float(motion[6]))
