"""The agent process: read poses and plans, call the pilot, publish plan and command."""

import logging
import math
import signal
import threading
import time
from collections.abc import Callable

import numpy as np

from agents.alarm import AlarmTimeLimit
from agents.assembly import TUNED, assemble
from agents.pilot import ControlOutput, Pilot
from agents.settings import AgentSettings
from agents.telemetry import command_message, plan_message, status_message
from bus import channels
from bus.heartbeat import LONGEST_WAIT_S, own_heartbeat
from bus.messages import AgentStatus
from bus.realtime import request_realtime, settle
from bus.session import Session
from bus.stepping import StepBus, SteppedSession

_LOG = logging.getLogger(__name__)

REPORT_PERIOD_S = 0.2
ORIENTATION_S = 0.5
"""Longest time after the start in which requests wait for the state of the transmitter."""


class Agent:
    """One vehicle's agent on the bus; what it does in a step follows from what the step takes in.

    Parameters
    ----------
    settings, pilot
        The vehicle's.
    bus
        Its seat on the bus, or a flight log that is replayed.
    realtime
        Whether the process runs in a real-time scheduling class.
    stopwatch
        Monotonic clock [s] that goes on during a step, for the duration of control steps.
    """

    def __init__(
        self,
        settings: AgentSettings,
        pilot: Pilot,
        bus: StepBus,
        realtime: bool,
        stopwatch: Callable[[], float] = time.monotonic,
    ) -> None:
        self._settings, self._pilot, self._bus, self._clock = settings, pilot, bus, bus.clock
        self._stopwatch = stopwatch
        parts = assemble(settings, pilot, bus, realtime)
        self._observation, self._handover, self._requests = parts.observation, parts.handover, parts.requests
        self._plans, self._peers, self._traffic = parts.plans, parts.peers, parts.traffic
        self._changes, self._lost, self._limit_scaling = parts.changes, parts.lost, parts.limit_scaling
        self._tuning, self._external, self._guard = parts.tuning, parts.external, parts.guard
        self._pacing, self._solve, self._diagnostics = parts.pacing, parts.solve, parts.diagnostics
        # Sequences continue over restarts because they start from the wall clock.
        self._first_sequence = bus.life
        self._control_by_s: float | None = None
        self._report_at_s = self._clock() + REPORT_PERIOD_S
        self._said: AgentStatus | None = None
        self._estimate: list[float] | None = None
        self._remarked: set[str] = set()
        # What is asked of an agent that has just restarted in flight waits until it knows that it flies.
        self._answer_from_s = self._clock() + ORIENTATION_S
        bus.serve(settings.vehicle, self._requests.verbs)
        bus.announce(settings.vehicle, "agent")

    def step(self) -> None:
        """Everything that is due now: read, decide, control, publish."""
        self._bus.begin_step()
        self._estimate = None
        self._read()
        self._decide()
        if self._control_by_s is not None and (
            self._clock() >= self._control_by_s or self._plans.complete(self._pilot.clock, self._followed())
        ):
            self._control()
        if self._clock() >= self._report_at_s:
            self._report()
        self._bus.end_step(self._settings.vehicle, self._estimate)

    def wait_for_tuning(self) -> None:
        """Wait until what is under way is prepared; for a replay, which is told by the log when that was."""
        self._tuning.wait()

    @property
    def flying(self) -> bool:
        """Whether the rotor of the vehicle turns, as far as is known."""
        return self._pilot.guidance.rotor_on

    def next_s(self) -> float:
        """Time of the next deadline [monotonic s]; messages wake the loop earlier."""
        if self._control_by_s is not None:
            return self._control_by_s
        overdue_at_s = self._observation.overdue_at_s
        return min(self._report_at_s, math.inf if overdue_at_s is None else overdue_at_s)

    def _read(self) -> None:
        """Take in requests, what the transmitter applied, and where the motion capture sees the vehicle."""
        if self._pilot.informed or self._clock() >= self._answer_from_s:
            for incoming in self._bus.pending():
                self._requests.handle(incoming)
                self._report_soon()
        was_flying = self._pilot.guidance.rotor_on
        self._observation.take_applied(self._first_sequence)
        if not was_flying and self._pilot.guidance.rotor_on and self._handover.resume():
            self._changes.keep_leaders()
            self._lost.expect()
        for began_s in self._observation.frames():
            self._begin_period(began_s)

    def _decide(self) -> None:
        """Settle what was waiting for a leader's plan, or for a controller to be built."""
        leaders_settled = self._changes.settle()
        tuned = self._bus.noted(TUNED) and self._requests.settle_tuning()
        if leaders_settled or tuned or self._tuning.note_replaced():
            self._report_soon()

    def _report_soon(self) -> None:
        """Whoever restarts this agent a moment later must know of a change."""
        self._report_at_s = self._clock()

    def _followed(self) -> list[str]:
        return [link.leader for link in self._pilot.guidance.followed]

    def _begin_period(self, now_s: float) -> None:
        self._changes.begin_due()
        clock, guidance = self._pilot.clock, self._pilot.guidance
        flying = guidance.rotor_on
        if self._pilot.informed and self._pacing.control_due(clock.current_frame, clock.period_s, flying):
            if self._control_by_s is not None and flying:
                self._pacing.on_overtaken()
            self._control_by_s = now_s + (self._settings.leader_wait_s if guidance.follows else 0)

    def _control(self) -> None:
        """Fly one control period and publish its command and plan."""
        self._control_by_s = None
        plans = self._plans.plans(self._pilot.clock, self._changes.cycles_from_frame)
        if self._lost.tend(plans):
            self._changes.keep_leaders()
        self._external.before_control()
        known = self._pilot.estimate
        self._estimate = np.concatenate((known.motion, known.actuator, known.disturbance)).tolist()
        started_s = self._stopwatch()
        output = self._pilot.control(plans, self._traffic.neighbours(self._pilot.clock, plans))
        self._solve.add(self._stopwatch() - started_s)
        # Followers wait for the plan of a leader, so that goes first; other vehicles send the command first.
        publish_first, publish_then = self._publish_command, self._publish_plan
        if not self._pilot.guidance.follows:
            publish_first, publish_then = publish_then, publish_first
        publish_first(output)
        publish_then(output)
        self._external.after_control()
        self._guard.watch(output, flown_by_own=not self._external.client)
        if self._said is not None and self._traffic.due():
            self._traffic.tend(self._said, self._peers.statuses())

    def _publish_command(self, output: ControlOutput) -> None:
        sequence = self._first_sequence + self._pilot.sequence
        command = command_message(self._settings, self._pilot, output, sequence)
        self._bus.publish(channels.COMMAND, self._settings.vehicle, command)

    def _publish_plan(self, output: ControlOutput) -> None:
        plan = plan_message(self._settings, self._pilot, output, self._plans)
        self._bus.publish(channels.PLAN, self._settings.vehicle, plan)

    def _report(self) -> None:
        """Publish status and intent; between them leaders are given the limits their followers leave them."""
        now_s = self._clock()
        self._report_at_s = now_s + REPORT_PERIOD_S
        links = {name: status.following for name, status in self._peers.statuses().items()}
        controller, chosen = self._pilot.controller, self._tuning.configuration.controller_settings
        self._pilot.step_guard.tell(controller, lambda: self._limit_scaling.tend(controller, chosen, links))
        plan_age_s = self._plans.plan_age_s(now_s, self._followed())
        diagnostics = self._diagnostics.collect(
            self._observation.pose_age_s, plan_age_s, self._external.client
        )
        for remark in set(diagnostics.remarks) - self._remarked:
            _LOG.warning(remark)
        self._remarked = set(diagnostics.remarks)
        self._said = status_message(self._pilot, self._lost.following_mode, diagnostics)
        self._bus.publish(channels.AGENT_STATUS, self._settings.vehicle, self._said)
        self._handover.publish()


def run_agent(settings: AgentSettings, pilot: Pilot) -> None:
    """Run the agent of one vehicle until SIGTERM or SIGINT.

    Parameters
    ----------
    settings
        The vehicle's settings.
    pilot
        Its pilot, built from the same settings; a spare process has it ready.

    Raises
    ------
    BusUnreachableError
        No router answers.
    """
    stop, wake = threading.Event(), threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    realtime = request_realtime(settings.realtime_priority)
    pilot.limit_time(AlarmTimeLimit())
    with Session(settings.bus, wake=wake.set) as session:
        agent = Agent(settings, pilot, SteppedSession(session), realtime)
        heartbeat = own_heartbeat()
        settle()
        while not stop.is_set():
            heartbeat.beat(agent.flying)
            wake.wait(max(0.0, min(agent.next_s() - session.clock(), LONGEST_WAIT_S)))
            wake.clear()
            agent.step()
        heartbeat.ending()
