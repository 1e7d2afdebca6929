"""Messages of an agent: commands, plans, status for other vehicles and people."""

import logging
import math
import os
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from rcopterx.agents.assembly import AgentParts
from rcopterx.agents.following.leader_plans import LeaderPlans, link_message, target_link
from rcopterx.agents.load import Relief
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.tuning.guard import effort_factors
from rcopterx.bus import channels
from rcopterx.bus.heartbeat import LONGEST_WAIT_S
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import (
    AgentStatus,
    Command,
    CommandTiming,
    Diagnostics,
    LeaderLink,
    Plan,
    Pose,
    SetPoint,
)
from rcopterx.bus.rounding import all_rounded, rounded
from rcopterx.bus.stepping import StepBus
from rcopterx.bus.subscription import Inbox, Received
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.vehicles.state import YAW, four, inertial_velocity, three

REFERENCE_BITS: Final = 14  # references are rounded to a sixteenth of a millimetre


def command_message(
    settings: AgentSettings, pilot: Pilot, flight: ControlOutput, lease: int, timing: CommandTiming | None
) -> Command:
    """Stick command of a control period."""
    return Command(
        epoch=pilot.clock.epoch,
        frame=pilot.clock.current_frame,
        lease=lease,
        sequence=pilot.sequence,
        input=four(flight.input),
        next_inputs=FloatArray.of(flight.next_inputs),
        period_s=settings.period_s,
        timing=timing,
    )


def timing_of(
    settings: AgentSettings, pilot: Pilot, seen: Received[Pose] | None, began_s: float, ready_s: float
) -> CommandTiming | None:
    """Return the stages that a command has passed, by `began_s` and `ready_s` [monotonic s], if known."""
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
        nominal=None if flight.nominal is None else TrajectoryArray.of(flight.nominal.samples),
    )


def _following(pilot: Pilot) -> tuple[LeaderLink, ...]:
    return tuple(
        link_message(link, link.offset_at(pilot.clock.time_s)) for link in pilot.guidance.task.followed
    )


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
        assigned=tuple(target_link(link) for link in pilot.guidance.task.assigned),
        following_mode=following_mode,
        position_m=None if motion is None else three(motion[:3]),
        velocity_m_s=None if motion is None else three(inertial_velocity(motion)),
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


REPORT_PERIOD_S: Final = 0.2
SPARSE: Final = 2  # factor of the period while the computer cannot keep up; a status counts for a second

DEVIATION_BITS: Final = 17  # standard deviations are rounded to a hundredth of a millimetre
HOVER_THRUST_BITS: Final = 10  # hover thrusts are rounded to a tenth of a per cent


class Reporter:
    """Publishes status and intent of one agent at `due_s` [monotonic s], and at once after a change."""

    def __init__(
        self, settings: AgentSettings, pilot: Pilot, bus: StepBus, parts: AgentParts, realtime: bool
    ) -> None:
        self._settings, self._pilot, self._bus, self._parts = settings, pilot, bus, parts
        self._realtime = realtime
        self._logged_remarks: set[str] = set()
        self.last_status: AgentStatus | None = None  # newest status that was published; None before the first
        self.begin()

    def begin(self) -> None:
        """Report a period from now on: an agent that takes over knows by then whether it flies."""
        self.due_s = self._bus.clock() + REPORT_PERIOD_S

    def request_report(self) -> None:
        """Report after the present control period, so that a successor of this agent knows of a change."""
        self.due_s = self._bus.clock()

    def report(self, now_s: float) -> None:
        """Publish status and intent."""
        pilot, parts, vehicle = self._pilot, self._parts, self._settings.vehicle
        slower = SPARSE if parts.relief.relief >= Relief.REPORTS else 1
        # A report waits for the end of a step, but the rate stays.
        self.due_s = max(self.due_s, now_s - LONGEST_WAIT_S) + slower * REPORT_PERIOD_S
        diagnostics = diagnostics_of(self._settings, pilot, parts, self._realtime, now_s)
        remarks = set(diagnostics.remarks)
        for remark in remarks - self._logged_remarks:
            logging.getLogger(__name__).warning(remark)
        self._logged_remarks = remarks
        self.last_status = status_message(pilot, parts.lost.following_mode, diagnostics)
        self._bus.publish(channels.AGENT_STATUS, vehicle, self.last_status)
        parts.handover.publish(now_s)


def diagnostics_of(
    settings: AgentSettings, pilot: Pilot, parts: AgentParts, realtime: bool, now_s: float
) -> Diagnostics:
    """Return the present figures of an agent; `realtime`: it runs in a real-time scheduling class."""
    configuration, relief = parts.tuning.configuration, parts.relief
    p50_ms, p99_ms, longest_ms = np.percentile(parts.solve_ms or (0.0,), (50, 99, 100)).tolist()
    flown = configuration.message
    remarks = (*pilot.remarks, parts.tuning.remark, relief.remark, parts.guard.remark)
    return Diagnostics(
        controller=flown.controller,
        estimator=flown.estimator,
        controller_settings=flown.controller_settings,
        estimator_settings=flown.estimator_settings,
        horizon=pilot.controller.horizon,
        effort_factor=max(effort_factors(configuration)),
        client=parts.external.client,
        pose_age_s=parts.poses.age_s(now_s),
        plan_age_s=parts.plans.plan_age_s(now_s, pilot.guidance.leaders),
        ticks=parts.pacing.ticks,
        missed_ticks=parts.pacing.missed_ticks,
        solve_ms_p50=p50_ms,
        solve_ms_p99=p99_ms,
        solve_ms_max=longest_ms,
        fallbacks=_summed(
            pilot.events,
            parts.external.events,
            parts.lost.events,
            parts.changes.events,
            parts.guard.events,
            parts.requests.events,
            relief.events,
        ),
        estimator_events=dict(pilot.estimator.events),
        rejected=_summed(
            _rejected(parts.poses),
            _rejected(parts.applied),
            _rejected(parts.external.answers),
            parts.plans.rejected,
            parts.traffic.rejected,
            pilot.cooperation.rejected,
        ),
        avoiding_ticks=pilot.avoidance.ticks,
        closest_plan_m=pilot.avoidance.closest_m,
        hover_thrust=_hover_thrust(pilot),
        wind_m_s2=_wind(pilot),
        position_deviation_m=_position_deviation(pilot),
        realtime=realtime,
        process=os.getpid(),
        host=settings.bus.host or None,
        remarks=tuple(filter(None, remarks)),
        processor_share=relief.processor_share(now_s),
        late_share=relief.overload.late_share,
        model=flown.model,
    )


def _summed(*counts: Mapping[str, int]) -> dict[str, int]:
    total: dict[str, int] = {}
    for each in counts:
        for kind, count in each.items():
            total[kind] = total.get(kind, 0) + count
    return total


def _rejected(inbox: Inbox[Any]) -> dict[str, int]:
    """Rejected messages by topic and reason."""
    return {f"{inbox.channel.topic}.{kind}": count for kind, count in inbox.rejected.items()}


def _hover_thrust(pilot: Pilot) -> float | None:
    """Share of the largest thrust at which the vehicle hovers; None on the floor."""
    learnt = pilot.vehicle_watch.hover_thrust if pilot.guidance.rotor_on else None
    return None if learnt is None else rounded(learnt, HOVER_THRUST_BITS)


def _wind(pilot: Pilot) -> tuple[float, float] | None:
    """Return the estimated wind [m/s^2]; None on the floor, where none is estimated."""
    if not pilot.guidance.rotor_on:
        return None
    estimate = pilot.estimate
    x, y = estimate.tilt.wind_m_s2 if estimate.has_tilt else estimate.disturbance[:2]
    return float(x), float(y)


def _position_deviation(pilot: Pilot) -> tuple[float, float, float] | None:
    """Return standard deviations of the position [m]; None on the floor, and if the estimator has none."""
    deviation = pilot.estimator.position_deviation_m() if pilot.guidance.rotor_on else None
    if deviation is None:
        return None
    x, y, z = all_rounded(deviation.tolist(), DEVIATION_BITS)
    return (x, y, z)
