"""Bus messages of an agent, built from what its pilot did."""

import os
from collections import Counter
from collections.abc import Mapping

import msgspec

from agents.following.leader_plans import LeaderPlans
from agents.following.links import present_link, target_link
from agents.pacing import Pacing, SolveTimer
from agents.pilot import ControlOutput, Pilot
from agents.settings import AgentSettings
from agents.tuning.configuration import Configuration
from bus.messages import AgentStatus, Command, FloatArray, LeaderLink, Plan, SetPoint, Setting
from vehicles.state import YAW, Array, heading_matrix


def command_message(settings: AgentSettings, pilot: Pilot, flight: ControlOutput, sequence: int) -> Command:
    """Stick command of a control period."""
    pitch, roll, thrust, yaw = flight.input.tolist()
    return Command(
        epoch=pilot.clock.epoch,
        frame=pilot.clock.current_frame,
        source=settings.vehicle,
        sequence=sequence,
        input=(pitch, roll, thrust, yaw),
        next_inputs=FloatArray.of(flight.next_inputs),
        period_s=settings.period_s,
    )


def plan_message(settings: AgentSettings, pilot: Pilot, flight: ControlOutput, leaders: LeaderPlans) -> Plan:
    """Plan of a control period."""
    reference = None
    if flight.reference is not None:
        x, y, z, yaw = flight.reference.tolist()
        reference = (x, y, z, yaw)
    return Plan(
        epoch=pilot.clock.epoch,
        frame=pilot.clock.current_frame,
        source=settings.vehicle,
        ancestors=leaders.ancestors(link.leader for link in pilot.guidance.followed),
        period_s=flight.plan.period_s,
        start_s=flight.start_s,
        airborne=pilot.guidance.rotor_on,
        trajectory=FloatArray.of(flight.plan.samples),
        reference=reference,
        following=_following(pilot) if pilot.guidance.follows else (),
        followable=pilot.guidance.followable,
    )


def _following(pilot: Pilot) -> tuple[LeaderLink, ...]:
    return tuple(present_link(link, pilot.clock.time_s) for link in pilot.guidance.followed)


def status_message(
    configuration: Configuration,
    pilot: Pilot,
    pacing: Pacing,
    solve: SolveTimer,
    pose_age_s: float | None,
    plan_age_s: float | None,
    rejected: Mapping[str, int],
    realtime: bool,
    following_mode: str,
    decisions: Counter[str],
    client: str,
) -> AgentStatus:
    """What the agent says of itself."""
    times = solve.times()
    position, yaw_rad = pilot.guidance.set_point()
    seen = pilot.clock.started
    motion = pilot.estimate.motion if seen else None
    events = getattr(pilot.estimator, "events", {})
    return AgentStatus(
        phase=pilot.guidance.phase.value,
        controller=configuration.controller,
        estimator=configuration.estimator,
        controller_settings=in_message(configuration.controller_settings),
        estimator_settings=in_message(configuration.estimator_settings),
        horizon=pilot.controller.horizon,
        epoch=pilot.clock.epoch,
        frame=pilot.clock.current_frame,
        set_point=SetPoint(position_m=_three(position), yaw_rad=yaw_rad),
        following=_following(pilot),
        position_m=None if motion is None else _three(motion[:3]),
        velocity_m_s=None if motion is None else _inertial_velocity(motion),
        yaw_rad=None if motion is None else float(motion[YAW]),
        pose_age_s=pose_age_s,
        plan_age_s=plan_age_s,
        ticks=pacing.ticks,
        missed_ticks=pacing.missed_ticks,
        solve_ms_p50=times.p50,
        solve_ms_p99=times.p99,
        solve_ms_max=times.maximum,
        fallbacks=dict(pilot.fallbacks + pilot.guidance.events + decisions),
        estimator_events=dict(events),
        rejected=dict(rejected),
        realtime=realtime,
        process=os.getpid(),
        assigned=tuple(target_link(link) for link in pilot.guidance.assigned),
        following_mode=following_mode,
        client=client,
        avoiding_ticks=pilot.avoiding_ticks,
        closest_plan_m=pilot.closest_m,
        path_left_s=pilot.guidance.path_left_s(pilot.clock.time_s),
    )


def in_message(settings: Mapping[str, object]) -> dict[str, Setting]:
    """Settings as they travel: numbers, words and rows of numbers."""
    return msgspec.convert(dict(settings), dict[str, Setting])


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return (x, y, z)


def _inertial_velocity(motion: Array) -> tuple[float, float, float]:
    x, y = (heading_matrix(float(motion[YAW])) @ motion[4:6]).tolist()
    return (x, y, float(motion[6]))
