"""What an agent is made of, and who of it knows whom."""

from dataclasses import dataclass
from typing import Final

from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.following.leader_changes import LeaderChanges
from rcopterx.agents.following.leader_plans import LeaderPlans
from rcopterx.agents.following.links import followed_leader
from rcopterx.agents.following.lost_leaders import LostLeaders
from rcopterx.agents.following.peers import PeerStatuses
from rcopterx.agents.formation.limit_scaling import LimitScaling
from rcopterx.agents.formation.placement import Room
from rcopterx.agents.load.load_relief import LoadRelief
from rcopterx.agents.load.pacing import Pacing, SolveTimer
from rcopterx.agents.observation import Observation
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.requests.external_control import ExternalControl
from rcopterx.agents.requests.request_handler import RequestHandler
from rcopterx.agents.separation.traffic import Traffic
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.takeover.handover import Handover
from rcopterx.agents.takeover.lease import ControlLease
from rcopterx.agents.telemetry import DiagnosticsCollector
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.guard import OscillationGuard
from rcopterx.bus import channels
from rcopterx.bus.stepping import StepBus

TUNED: Final = "tuned"
"""Note of the thread that prepares another controller."""
TRAJECTORY_CHECKED: Final = "trajectory_checked"
"""Note of the thread that checks a trajectory."""


@dataclass(frozen=True)
class AgentParts:
    """Parts of an agent beside its pilot; what each does is told where it is defined."""

    lease: ControlLease
    observation: Observation
    handover: Handover
    requests: RequestHandler
    plans: LeaderPlans
    peers: PeerStatuses
    traffic: Traffic
    changes: LeaderChanges
    lost: LostLeaders
    limit_scaling: LimitScaling
    tuning: Tuning
    external: ExternalControl
    guard: OscillationGuard
    relief: LoadRelief
    pacing: Pacing
    solve: SolveTimer
    diagnostics: DiagnosticsCollector


def build_pilot(settings: AgentSettings) -> Pilot:
    """Pilot with the controller, the estimator and the leaders of the settings.

    Raises
    ------
    ValueError
        Unknown controller or estimator, or a setting it does not accept.
    """
    configuration = settings.configuration
    model, period_s, scale = settings.model, settings.period_s, settings.limit_scale
    controller = configuration.controller_for(model, period_s, scale)
    estimator = configuration.estimator_for(model, period_s)
    default_controller, default_estimator = controller, estimator
    plain = configuration.with_default_controller()
    if plain != configuration:
        default_controller = plain.controller_for(model, period_s, scale)
    plain = configuration.with_default_estimator()
    if plain != configuration:
        default_estimator = plain.estimator_for(model, period_s)
    return Pilot(
        model,
        controller,
        estimator,
        Guidance([followed_leader(link) for link in settings.following]),
        settings.separation,
        default_controller,
        default_estimator,
        settings.hover_thrust_limits,
    )


def assemble(settings: AgentSettings, pilot: Pilot, bus: StepBus, realtime: bool) -> AgentParts:
    """Parts of an agent, subscribed to what they need.

    Parameters
    ----------
    settings, pilot
        The vehicle's, the pilot built from the settings.
    bus
        The agent's seat on it.
    realtime
        Whether the process runs in a real-time scheduling class.
    """
    vehicle, clock = settings.vehicle, bus.clock
    pacing, solve = Pacing(settings.period_s, settings.vehicles.index(vehicle)), SolveTimer()
    poses = bus.subscribe(channels.POSE, vehicle, depth=32)
    # What was written counts from the next pose on; to wake up for it would double the steps of a leader.
    applied = bus.subscribe(channels.APPLIED, vehicle, depth=16, waking=False)
    lease = ControlLease(bus.life, settings.take_over, clock())
    observation = Observation(pilot, pacing, poses, applied, lease, clock)
    plans = LeaderPlans(vehicle, lambda name: bus.subscribe(channels.PLAN, name))
    plans.keep(link.leader for link in settings.following)
    # Statuses are looked up when they are needed; they wake nobody.
    statuses = bus.subscribe_all(channels.AGENT_STATUS, waking=False)
    peers = PeerStatuses(vehicle, statuses.inboxes, clock)
    traffic = Traffic(
        vehicle, settings.separation, lambda name: bus.subscribe(channels.PLAN, name, waking=False)
    )
    tuning = Tuning(
        settings.configuration, pilot, settings.period_s, settings.limit_scale, lambda: bus.note(TUNED)
    )
    external = ExternalControl(
        vehicle,
        pilot,
        bus.subscribe(channels.EXTERNAL_INPUT, vehicle, depth=8),
        lambda task: bus.publish(channels.CONTROL_TASK, vehicle, task),
    )
    room = Room(settings.volume_min_m, settings.volume_max_m, settings.minimum_distance_m)
    changes = LeaderChanges(vehicle, settings.vehicles, room, pilot, plans, peers, clock)
    lost = LostLeaders(vehicle, settings.succession, pilot, plans, peers, clock)
    guard = OscillationGuard(pilot, tuning)
    requests = RequestHandler(
        settings, pilot, room, changes, peers, tuning, external, lambda: bus.note(TRAJECTORY_CHECKED)
    )
    host = settings.bus.host
    launcher = bus.subscribe(channels.LAUNCHER, host, waking=False) if host else None
    relief = LoadRelief(bus, settings.period_s, pacing, traffic, launcher)
    counted = (pilot, observation, plans, traffic, external, lost, changes, guard, requests, relief)
    return AgentParts(
        lease=lease,
        observation=observation,
        handover=Handover(bus, settings, lease, pilot, tuning),
        requests=requests,
        plans=plans,
        peers=peers,
        traffic=traffic,
        changes=changes,
        lost=lost,
        limit_scaling=LimitScaling(vehicle, settings.models),
        tuning=tuning,
        external=external,
        guard=guard,
        relief=relief,
        pacing=pacing,
        solve=solve,
        diagnostics=DiagnosticsCollector(
            pilot, tuning, pacing, solve, relief, guard, counted, realtime, settings.bus.host
        ),
    )
