"""Bus messages of an agent, built from what its pilot did."""

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, Protocol

import msgspec

from rcopterx.agents.following.leader_plans import LeaderPlans
from rcopterx.agents.following.links import present_link, target_link
from rcopterx.agents.following.plan_arrays import packed
from rcopterx.agents.load.load_relief import LoadRelief
from rcopterx.agents.load.pacing import Pacing, SolveTimer
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.guard import OscillationGuard, effort_factors
from rcopterx.bus.message import FloatArray, Setting
from rcopterx.bus.messages import AgentStatus, Command, Diagnostics, LeaderLink, Plan, Pose, SetPoint
from rcopterx.bus.rounding import all_rounded, rounded
from rcopterx.bus.subscription import Received
from rcopterx.bus.timing import CommandTiming
from rcopterx.vehicles.state import YAW, Array, heading_matrix
from rcopterx.vehicles.tuples import three

REFERENCE_BITS: Final = 14
"""References are told to a sixteenth of a millimetre."""

DEVIATION_BITS: Final = 17
"""Standard deviations are told to a hundredth of a millimetre."""

HOVER_THRUST_BITS: Final = 10
"""Hover thrusts are told to a tenth of a per cent."""


class Source(Protocol):
    """A part of an agent that counts what happens to it."""

    @property
    def events(self) -> Mapping[str, int]:
        """Fallbacks and decisions since the start, by kind."""
        ...

    @property
    def rejected(self) -> Mapping[str, int]:
        """Messages refused since the start, by topic and reason."""
        ...


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
    """Stages that a command has passed so far.

    Parameters
    ----------
    settings, pilot
        The vehicle's.
    seen
        Newest pose.
    began_s, ready_s
        When the controller began and had finished [monotonic s].

    Returns
    -------
    CommandTiming or None
        None where the frame was predicted, or where hosts have no names.
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
        ancestors=leaders.ancestors(link.leader for link in pilot.guidance.followed),
        period_s=flight.plan.period_s,
        start_s=flight.start_s,
        airborne=pilot.guidance.rotor_on,
        trajectory=packed(flight.plan.samples, flight.plan.period_s),
        reference=reference,
        following=_following(pilot) if pilot.guidance.follows else (),
        followable=pilot.guidance.followable,
    )


def _following(pilot: Pilot) -> tuple[LeaderLink, ...]:
    return tuple(present_link(link, pilot.clock.time_s) for link in pilot.guidance.followed)


def status_message(pilot: Pilot, following_mode: str, diagnostics: Diagnostics) -> AgentStatus:
    """What the vehicle does."""
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


class DiagnosticsCollector:
    """Puts together how well an agent works.

    Parameters
    ----------
    pilot, tuning, pacing, solve, relief, guard
        The agent's own.
    sources
        All parts of the agent that count what happens to them.
    realtime
        Whether the process runs in a real-time scheduling class.
    host
        Where it runs; empty where hosts have no names.
    """

    def __init__(
        self,
        pilot: Pilot,
        tuning: Tuning,
        pacing: Pacing,
        solve: SolveTimer,
        relief: LoadRelief,
        guard: OscillationGuard,
        sources: Sequence[Source],
        realtime: bool,
        host: str,
    ) -> None:
        self._host = host or None
        self._pilot = pilot
        self._tuning = tuning
        self._pacing = pacing
        self._solve = solve
        self._relief = relief
        self._guard = guard
        self._sources = sources
        self._realtime = realtime

    def collect(self, pose_age_s: float | None, plan_age_s: float | None, client: str) -> Diagnostics:
        """Present figures; ages of the newest pose and plan, and the external program that flies, if any."""
        pilot, times = self._pilot, self._solve.times()
        configuration = self._tuning.configuration
        return Diagnostics(
            controller=configuration.controller,
            estimator=configuration.estimator,
            controller_settings=in_message(configuration.controller_settings),
            estimator_settings=in_message(configuration.estimator_settings),
            horizon=pilot.controller.horizon,
            effort_factor=max(effort_factors(configuration)),
            client=client,
            pose_age_s=pose_age_s,
            plan_age_s=plan_age_s,
            ticks=self._pacing.ticks,
            missed_ticks=self._pacing.missed_ticks,
            solve_ms_p50=times.p50,
            solve_ms_p99=times.p99,
            solve_ms_max=times.maximum,
            fallbacks=_summed(source.events for source in self._sources),
            estimator_events=dict(pilot.estimator.events),
            rejected=_summed(source.rejected for source in self._sources),
            avoiding_ticks=pilot.avoidance.ticks,
            closest_plan_m=pilot.avoidance.closest_m,
            hover_thrust=_hover_thrust(pilot),
            wind_m_s2=_wind(pilot),
            position_deviation_m=_position_deviation(pilot),
            realtime=self._realtime,
            process=os.getpid(),
            host=self._host,
            remarks=(
                *pilot.remarks,
                *filter(None, (self._tuning.remark, self._relief.remark, self._guard.remark)),
            ),
            processor_share=self._relief.processor_share(),
        )


def _wind(pilot: Pilot) -> tuple[float, float] | None:
    """What the estimator takes for wind [m/s^2]; None on the floor, where it estimates none."""
    if not pilot.guidance.rotor_on:
        return None
    estimate = pilot.estimate
    x, y = estimate.tilt.wind_m_s2 if estimate.has_tilt else estimate.disturbance[:2]
    return float(x), float(y)


def _error_m(pilot: Pilot) -> float | None:
    """Distance of the plan's beginning from the reference [m]; None on the floor."""
    if pilot.plan is None or pilot.reference is None:
        return None
    return rounded(
        math.dist(pilot.plan.samples[0, :3].tolist(), pilot.reference[:3].tolist()), REFERENCE_BITS
    )


def _hover_thrust(pilot: Pilot) -> float | None:
    """Share of the largest thrust at which the vehicle hovers; None on the floor."""
    learnt = pilot.self_check.hover_thrust if pilot.guidance.rotor_on else None
    return None if learnt is None else rounded(learnt, HOVER_THRUST_BITS)


def _position_deviation(pilot: Pilot) -> tuple[float, float, float] | None:
    """How well the estimator knows where the vehicle is [m]; None on the floor, and if it does not tell."""
    deviation = pilot.estimator.position_deviation_m() if pilot.guidance.rotor_on else None
    if deviation is None:
        return None
    x, y, z = all_rounded(deviation.tolist(), DEVIATION_BITS)
    return (x, y, z)


class _Settings(msgspec.Struct):
    """A structure, because msgspec looks at the types of all others again in each conversion."""

    settings: dict[str, Setting]


def in_message(settings: Mapping[str, object]) -> dict[str, Setting]:
    """Settings as they travel: numbers, strings and rows of numbers."""
    return msgspec.convert({"settings": settings}, _Settings).settings


def prefixed(topic: str, counts: Mapping[str, int]) -> dict[str, int]:
    """Counts of refused messages by topic and reason."""
    return {f"{topic}.{kind}": count for kind, count in counts.items()}


def _summed(counts: Iterable[Mapping[str, int]]) -> dict[str, int]:
    total: dict[str, int] = {}
    for each in counts:
        for kind, count in each.items():
            total[kind] = total.get(kind, 0) + count
    return total


def _inertial_velocity(motion: Array) -> tuple[float, float, float]:
    x, y = (heading_matrix(float(motion[YAW])) @ motion[4:6]).tolist()
    return (x, y, float(motion[6]))
