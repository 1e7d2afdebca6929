"""The parts of an agent, and how they are connected."""

import time
from collections import deque
from functools import partial
from typing import Final

from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.following.leader_changes import LeaderChanges
from rcopterx.agents.following.leader_plans import LeaderPlans, PeerStatuses, followed_leader
from rcopterx.agents.following.lost_leaders import LostLeaders
from rcopterx.agents.following.traffic import Traffic
from rcopterx.agents.load import Pacing
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.relief import LoadRelief
from rcopterx.agents.requests.external_control import ExternalControl
from rcopterx.agents.requests.request_handler import RequestHandler
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.takeover import ControlLease, Handover
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.guard import OscillationGuard
from rcopterx.bus import channels
from rcopterx.bus.stepping import StepBus
from rcopterx.bus.subscription import Inbox

LIFT_OFF_TURNS: Final = 3
LIFT_OFF_TURN_S: Final = 0.55
"""`LIFT_OFF_TURNS`, `LIFT_OFF_TURN_S`: vehicles that take off together lift off one after another, in so many
turns, so that the pose of one whose subject or radio is another's rises at the wrong time."""
TUNED: Final = "tuned"  # event of the thread that prepares another controller
TRAJECTORY_CHECKED: Final = "trajectory_checked"  # event of the thread that checks a trajectory
SOLVE_WINDOW: Final = 500  # number of control steps whose durations are reported


def build_pilot(settings: AgentSettings) -> Pilot:
    """Return the pilot of the settings; `ValueError` for a name or a setting that does not exist."""
    parts = settings.configuration.parts(settings.model, settings.period_s)
    pilot = Pilot(
        parts.model,
        parts.controller,
        parts.estimator,
        Guidance(
            [followed_leader(link) for link in settings.following], deviation_share=settings.deviation_share
        ),
        settings.separation,
        parts.default_controller,
        parts.default_estimator,
        settings.hover_thrust_limits,
    )
    pilot.cooperation.vehicle = settings.vehicle
    turn = settings.vehicles.index(settings.vehicle) % LIFT_OFF_TURNS
    pilot.lift_off_delay_s = turn * LIFT_OFF_TURN_S
    return pilot


class AgentParts:
    """Parts of an agent beside its pilot. Replays find a subscription by its number: its order counts."""

    def __init__(self, settings: AgentSettings, pilot: Pilot, bus: StepBus) -> None:
        vehicle, clock, host = settings.vehicle, bus.clock, settings.bus.host
        self.pacing = Pacing(settings.period_s, settings.vehicles.index(vehicle))
        self.solve_ms: deque[float] = deque(maxlen=SOLVE_WINDOW)  # durations of the last control steps
        self.lease = ControlLease(bus.life, settings.take_over, clock())
        # Observation
        self.poses = bus.subscribe(channels.POSE, vehicle, depth=32)
        # It counts from the next pose on: waking up for it would double the steps of a leader.
        self.applied = bus.subscribe(channels.APPLIED, vehicle, depth=16, waking=False)
        # Other vehicles
        # Late plans count in the next period.
        self.plans: LeaderPlans = LeaderPlans(
            vehicle, partial(bus.subscribe, channels.PLAN, waking=lambda: self.plans.awaited)
        )
        self.plans.subscribe_to(link.leader for link in settings.following)
        statuses = bus.subscribe_all(channels.AGENT_STATUS, waking=False)
        self.peers = PeerStatuses(vehicle, statuses, clock)
        self.traffic = Traffic(
            vehicle, settings.separation, partial(bus.subscribe, channels.PLAN, waking=False)
        )
        self.changes = LeaderChanges(
            vehicle, settings.vehicles, settings.room, pilot, self.plans, self.peers, clock
        )
        self.lost = LostLeaders(vehicle, settings.succession, pilot, self.plans, self.peers, clock)
        # Controllers
        self.tuning = Tuning(settings.configuration, pilot, settings.period_s, partial(bus.note, TUNED))
        self.guard = OscillationGuard(pilot, self.tuning)
        external_inputs = bus.subscribe(channels.EXTERNAL_INPUT, vehicle, depth=8, waking=False)
        publish_task = partial(bus.publish, channels.CONTROL_TASK, vehicle)
        self.external = ExternalControl(vehicle, pilot, external_inputs, publish_task)
        wake = partial(bus.note, TRAJECTORY_CHECKED)
        self.requests = RequestHandler(
            settings, pilot, self.changes, self.peers, self.tuning, self.external, wake
        )
        # Processes
        launcher = bus.subscribe(channels.LAUNCHER, host, waking=False) if host else Inbox(channels.LAUNCHER)
        processor_clock = settings.bus.clock.scaled(time.process_time)
        self.relief = LoadRelief(bus, settings.period_s, self.pacing, self.traffic, launcher, processor_clock)
        self.handover = Handover(bus, settings, self.lease, pilot, self.tuning)
        self.lease_answers = bus.subscribe(channels.LEASE, vehicle, depth=16)
        # Schemes
        self.scheme_messages = bus.subscribe_all(channels.SCHEME, waking=False)
