"""Messages of an agent: commands, plans, status for other vehicles and people."""

import logging
import math
import os
from collections import Counter
from collections.abc import Sequence
from typing import Any, Final, Protocol

from rcopterx.agents.following.leader_plans import LeaderPlans, link_message, target_link
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.tuning.changes import Tuning
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
    ZoneSet,
)
from rcopterx.bus.rounding import all_rounded, rounded
from rcopterx.bus.stepping import StepBus
from rcopterx.bus.subscription import Inbox, Received
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.formation.succession import FollowingMode
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
        given_up=pilot.given_up,
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


def error_m(pilot: Pilot) -> float | None:
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


class Reports(Protocol):
    """A part of an agent that reports its state."""

    def report(self, to: Diagnostics, now_s: float) -> None:
        """Set, and add to, what this part has for the diagnostics."""


class Reporter:
    """Publishes the status of one agent at `due_s` [monotonic s], and at once after a change."""

    def __init__(
        self,
        settings: AgentSettings,
        pilot: Pilot,
        bus: StepBus,
        tuning: Tuning,
        parts: Sequence[Reports],
        inboxes: Sequence[Inbox[Any]],
        realtime: bool,
    ) -> None:
        self._settings, self._pilot, self._bus = settings, pilot, bus
        self._tuning, self._parts, self._inboxes = tuning, parts, inboxes
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

    def report(
        self,
        now_s: float,
        sparse: bool,
        mode: FollowingMode,
        pose_age_s: float | None,
        late_share: float,
        zones: ZoneSet | None,
    ) -> None:
        """Publish the status; `sparse`: at half the rate."""
        # A report waits for the end of a step, but the rate stays.
        self.due_s = max(self.due_s, now_s - LONGEST_WAIT_S) + (SPARSE if sparse else 1) * REPORT_PERIOD_S
        pilot, clock, guidance = self._pilot, self._pilot.clock, self._pilot.guidance
        position, yaw_rad = guidance.set_point()
        motion = pilot.estimate.motion if clock.started else None
        self.last_status = AgentStatus(
            phase=guidance.task.phase.value,
            epoch=clock.epoch,
            frame=clock.current_frame,
            set_point=SetPoint(position_m=three(position), yaw_rad=yaw_rad),
            following=_following(pilot),
            assigned=tuple(map(target_link, guidance.task.assigned)),
            following_mode=mode,
            position_m=None if motion is None else three(motion[:3]),
            velocity_m_s=None if motion is None else three(inertial_velocity(motion)),
            yaw_rad=None if motion is None else float(motion[YAW]),
            error_m=error_m(pilot),
            path_left_s=guidance.path_left_s(clock.time_s),
            excitation_left_s=pilot.exciter.left_s(clock.time_s),
            excitation=pilot.exciter.outcome,
            diagnostics=self._diagnostics(now_s),
            pose_age_s=pose_age_s,
            late_share=late_share,
            host=self._settings.bus.host or None,
            home_m=None if (home_m := guidance.task.home_m) is None else (*home_m, guidance.task.floor_m),
            zones=zones,
        )
        self._bus.publish(channels.AGENT_STATUS, self._settings.vehicle, self.last_status)

    def _diagnostics(self, now_s: float) -> Diagnostics:
        """Collect what the parts report, and log new remarks."""
        found = self._tuning.diagnostics()
        _report_pilot(self._pilot, found)
        for inbox in self._inboxes:
            found.rejected |= {f"{inbox.channel.topic}.{kind}": n for kind, n in inbox.rejected.items()}
        for part in self._parts:
            part.report(found, now_s)
        found.realtime, found.process = self._realtime, os.getpid()
        found.remarks = tuple(filter(None, found.remarks))
        remarks = set(found.remarks)
        for remark in remarks - self._logged_remarks:
            logging.getLogger(__name__).warning(remark)
        self._logged_remarks = remarks
        return found


def _report_pilot(pilot: Pilot, to: Diagnostics) -> None:
    """Report a pilot, which knows no messages; what is estimated in flight only is absent on the floor."""
    to.fallbacks = dict(pilot.events + Counter(pilot.estimator.events))
    to.rejected |= pilot.cooperation.rejected
    to.avoiding_ticks, to.closest_plan_m = pilot.avoidance.ticks, pilot.avoidance.closest_m
    to.remarks += pilot.remarks
    if not pilot.guidance.rotor_on:
        return
    learnt, deviation = pilot.vehicle_watch.hover_thrust, pilot.estimator.position_deviation_m()
    to.hover_thrust = None if learnt is None else rounded(learnt, HOVER_THRUST_BITS)
    estimate = pilot.estimate
    x, y = estimate.tilt.wind_m_s2 if estimate.has_tilt else estimate.disturbance[:2]
    to.wind_m_s2 = float(x), float(y)
    if deviation is not None:
        x, y, z = all_rounded(deviation.tolist(), DEVIATION_BITS)
        to.position_deviation_m = (x, y, z)
