"""The agent process: read poses and plans, call the pilot, publish plan and command."""

import math
import signal
import threading
import time

import numpy as np

from agents.external_control import ExternalControl
from agents.flight.guidance import Guidance
from agents.following.leader_plans import LeaderPlans
from agents.following.links import followed_leader
from agents.following.lost_leaders import LostLeaders
from agents.following.peers import PeerStatuses
from agents.formation.limit_scaling import LimitScaling
from agents.interfaces import Measurement
from agents.pacing import Pacing, SolveTimer
from agents.phases import AIRBORNE
from agents.pilot import ControlOutput, Pilot, StampedMeasurement
from agents.request_handler import RequestHandler
from agents.separation.traffic import Traffic
from agents.settings import AgentSettings
from agents.telemetry import command_message, plan_message, status_message
from agents.tuning.changes import Tuning
from bus import channels
from bus.messages import AgentStatus, Pose
from bus.realtime import request_realtime, settle
from bus.requests import Recall, RecallReply
from bus.session import RequestFailedError, Session

STATUS_PERIOD_S = 0.2
IDLE_S = 0.1
ORIENTATION_S = 0.5
"""Longest time after the start in which requests wait for the state of the transmitter."""


def build_pilot(settings: AgentSettings) -> Pilot:
    """Pilot with the controller, the estimator and the leaders of the settings.

    Raises
    ------
    ValueError
        Unknown controller or estimator, or a setting it does not accept.
    """
    configuration = settings.configuration
    return Pilot(
        settings.model,
        configuration.controller_for(settings.model, settings.period_s, settings.share),
        configuration.estimator_for(settings.model, settings.period_s),
        Guidance([followed_leader(link) for link in settings.following]),
        settings.clearance,
    )


class Agent:
    """One vehicle's agent on the bus."""

    def __init__(self, settings: AgentSettings, pilot: Pilot, session: Session, realtime: bool) -> None:
        self._settings = settings
        self._pilot = pilot
        self._session = session
        self._realtime = realtime
        self._clock = session.clock
        vehicle = settings.vehicle
        self._poses = session.subscribe(channels.POSE, vehicle, depth=16)
        self._applied = session.subscribe(channels.APPLIED, vehicle, depth=16)
        self._leaders = LeaderPlans(vehicle, lambda name: session.subscribe(channels.PLAN, name))
        self._leaders.keep(link.leader for link in settings.following)
        # Statuses are looked up when they are needed; they wake nobody.
        statuses = session.subscribe_all(channels.AGENT_STATUS, waking=False)
        self._neighbours = PeerStatuses(vehicle, statuses.inboxes, self._clock)
        self._traffic = Traffic(
            vehicle, settings.clearance, lambda name: session.subscribe(channels.PLAN, name, waking=False)
        )
        self._tuning = Tuning(settings.configuration, pilot, settings.period_s, settings.share, session.wake)
        self._answers = session.subscribe(channels.EXTERNAL_INPUT, vehicle, depth=8)
        self._external = ExternalControl(
            vehicle, pilot, self._answers, lambda task: session.publish(channels.CONTROL_TASK, vehicle, task)
        )
        self._desk = RequestHandler(
            settings, pilot, self._leaders, self._neighbours, self._tuning, self._external, self._clock
        )
        self._lost = LostLeaders(
            vehicle, settings.succession, pilot, self._leaders, self._neighbours, self._clock
        )
        self._authority = LimitScaling(vehicle, settings.models)
        self._pacing = Pacing(settings.period_s)
        self._solve = SolveTimer()
        # Sequences continue over restarts because they start from the wall clock.
        self._sequence = time.time_ns() // 1_000_000
        self._control_by_s: float | None = None
        self._status_at_s = self._clock() + STATUS_PERIOD_S
        self._said: AgentStatus | None = None
        self._previous = self._recall()
        # What is asked of an agent that has just restarted in flight waits until it knows that it flies.
        self._answer_from_s = self._clock() + ORIENTATION_S
        session.serve(vehicle, self._desk.verbs)
        session.announce(vehicle, "agent")

    def step(self) -> None:
        """Everything that is due now."""
        if self._pilot.informed or self._clock() >= self._answer_from_s:
            for incoming in self._session.pending():
                self._desk.handle(incoming)
                self._status_at_s = self._clock()
        leaders_changed, tuned = self._desk.leading.settle_waiting(), self._desk.settle_tuning()
        if leaders_changed or tuned:
            # Whoever restarts this agent a moment later must know of it.
            self._status_at_s = self._clock()
        self._observe()
        if self._control_by_s is not None and (
            self._clock() >= self._control_by_s or self._leaders.complete(self._pilot.clock, self._followed())
        ):
            self._control()
        if self._clock() >= self._status_at_s:
            self._report()

    def next_s(self) -> float:
        """Time of the next deadline [monotonic s]; messages wake the loop earlier."""
        if self._control_by_s is not None:
            return self._control_by_s
        coast_at_s = self._pacing.coast_at_s(self._pilot.clock.period_s)
        return min(self._status_at_s, math.inf if coast_at_s is None else coast_at_s)

    def _observe(self) -> None:
        for applied in self._applied.drain():
            before = self._pilot.guidance.phase
            sequence = applied.message.sequence - self._sequence
            self._pilot.note_applied(applied.message.state, sequence, np.array(applied.message.input))
            if before not in AIRBORNE and self._pilot.guidance.phase in AIRBORNE and self._previous:
                self._desk.resume(self._previous)
                self._lost.expect()
        for received in self._poses.drain():
            if self._pilot.observe(_frame(received.message)):
                self._pacing.on_pose(received.arrived_s)
                if self._pilot.ready:
                    self._begin_control(received.arrived_s)
        coast_at_s = self._pacing.coast_at_s(self._pilot.clock.period_s)
        if coast_at_s is not None and self._clock() >= coast_at_s:
            self._pacing.on_coast()
            if self._pilot.coast():
                self._begin_control(coast_at_s)

    def _followed(self) -> list[str]:
        return [link.leader for link in self._pilot.guidance.followed]

    def _begin_control(self, now_s: float) -> None:
        self._desk.leading.begin_due()
        clock = self._pilot.clock
        flying = self._pilot.guidance.rotor_on
        if self._pilot.informed and self._pacing.control_due(clock.current_frame, clock.period_s, flying):
            if self._control_by_s is not None and flying:
                self._pacing.on_overtaken()
            self._control_by_s = now_s + (self._settings.leader_wait_s if self._pilot.guidance.follows else 0)

    def _control(self) -> None:
        self._control_by_s = None
        plans = self._leaders.plans(self._pilot.clock, self._desk.leading.cycles_from_frame)
        if self._lost.tend(plans):
            self._desk.leading.keep_leaders()
        self._external.before_control()
        started_s = self._clock()
        flight = self._pilot.control(plans, self._traffic.neighbours(self._pilot.clock, plans))
        self._solve.add(self._clock() - started_s)
        # Followers wait for the plan of a leader, so that goes first; other vehicles send the command first.
        publish_first, publish_then = self._publish_command, self._publish_plan
        if not self._pilot.guidance.follows:
            publish_first, publish_then = publish_then, publish_first
        publish_first(flight)
        publish_then(flight)
        self._external.after_control()
        if self._said is not None and self._traffic.due():
            self._traffic.tend(self._said, self._neighbours.statuses())

    def _publish_command(self, flight: ControlOutput) -> None:
        sequence = self._sequence + self._pilot.sequence
        command = command_message(self._settings, self._pilot, flight, sequence)
        self._session.publish(channels.COMMAND, self._settings.vehicle, command)

    def _publish_plan(self, flight: ControlOutput) -> None:
        plan = plan_message(self._settings, self._pilot, flight, self._leaders)
        self._session.publish(channels.PLAN, self._settings.vehicle, plan)

    def _recall(self) -> AgentStatus | None:
        try:
            reply = self._session.request(self._settings.vehicle, Recall(), timeout_s=0.2, patience_s=0.0)
        except RequestFailedError:
            return None
        return reply.status if isinstance(reply, RecallReply) else None

    def _report(self) -> None:
        now_s = self._clock()
        self._status_at_s = now_s + STATUS_PERIOD_S
        others = {name: status.following for name, status in self._neighbours.statuses().items()}
        self._authority.tend(self._pilot.controller, self._tuning.configuration.controller_settings, others)
        rejected = {f"pose.{kind}": count for kind, count in self._poses.rejected.items()}
        rejected |= {f"applied.{kind}": count for kind, count in self._applied.rejected.items()}
        rejected |= {f"external_input.{kind}": count for kind, count in self._answers.rejected.items()}
        rejected |= self._leaders.counts() | self._traffic.counts()
        decisions = self._lost.events + self._external.events
        decisions += self._desk.leading.events + self._desk.leading.regrouping.events
        status = status_message(
            self._tuning.configuration, self._pilot, self._pacing, self._solve,
            self._poses.age_s(now_s), self._leaders.plan_age_s(now_s, self._followed()), rejected,
            self._realtime, self._lost.following_mode, decisions, self._external.client,
        )  # fmt: skip
        self._said = status
        self._session.publish(channels.AGENT_STATUS, self._settings.vehicle, status)


def run_agent(settings: AgentSettings, pilot: Pilot) -> None:
    """Run the agent of one vehicle until SIGTERM or SIGINT.

    Parameters
    ----------
    settings
        The vehicle's settings.
    pilot
        Its pilot, built by `build_pilot` from the same settings; a spare process has it ready.

    Raises
    ------
    BusUnreachableError
        No router answers.
    """
    stop, wake = threading.Event(), threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    realtime = request_realtime(settings.realtime_priority)
    with Session(settings.bus, wake=wake.set) as session:
        agent = Agent(settings, pilot, session, realtime)
        settle()
        while not stop.is_set():
            wake.wait(max(0.0, min(agent.next_s() - session.clock(), IDLE_S)))
            wake.clear()
            agent.step()


def _frame(pose: Pose) -> StampedMeasurement:
    measurement = None
    if pose.position_m is not None and pose.quaternion_xyzw is not None:
        x, y, z, w = pose.quaternion_xyzw
        yaw_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        measurement = Measurement(np.array(pose.position_m), yaw_rad)
    return StampedMeasurement(pose.epoch, pose.frame, pose.period_s, measurement)
