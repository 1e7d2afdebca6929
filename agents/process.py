"""The agent process: read poses and plans, call the pilot, publish plan and command."""

import math
import signal
import threading
import time
from collections.abc import Callable

from rcopterx.agents.assembly import TRAJECTORY_CHECKED, TUNED, assemble
from rcopterx.agents.guards.time_limit import AlarmTimeLimit, NotedTimeLimit, NoTimeLimit, TimeLimit
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.reporting import Reporter
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.telemetry import command_message, plan_message, timing_of
from rcopterx.bus import channels
from rcopterx.bus.heartbeat import LONGEST_WAIT_S, Heartbeat, own_heartbeat
from rcopterx.bus.messages import LeaseBid
from rcopterx.bus.realtime import request_realtime, settle
from rcopterx.bus.rounding import monotonic_s
from rcopterx.bus.session import Session
from rcopterx.bus.stepping import StepBus, SteppedSession
from rcopterx.bus.timing import CommandTiming

ORIENTATION_S = 0.5
"""Longest time after the start in which requests wait for the state of the transmitter."""
LARGEST_WAITING_SHARE = 0.5
"""Of a control period that a follower far down the line waits for plans at most."""


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
    limit
        Gives up calls of controllers and estimators that take too long; None for none.
    """

    def __init__(
        self,
        settings: AgentSettings,
        pilot: Pilot,
        bus: StepBus,
        realtime: bool,
        stopwatch: Callable[[], float] = monotonic_s,
        limit: TimeLimit | None = None,
    ) -> None:
        self._settings, self._pilot, self._bus = settings, pilot, bus
        self._stopwatch = stopwatch
        self._limit = NotedTimeLimit(NoTimeLimit() if limit is None else limit)
        pilot.limit_time(self._limit)
        self._parts = assemble(settings, pilot, bus, realtime)
        self._reporter = Reporter(settings, pilot, bus, self._parts)
        self._control_by_s: float | None = None
        self._now_s = self._began_s = self._step_s = 0.0
        self._estimate: list[float] | None = None
        self._timing: CommandTiming | None = None
        self._leases = bus.subscribe(channels.LEASE, settings.vehicle, depth=16)
        self._answer_from_s = math.inf
        self._speaks = False

    @property
    def lost(self) -> bool:
        """Whether another agent flies the vehicle now: there is nothing left to do."""
        return self._parts.lease.lost

    def step(self) -> None:
        """Everything that is due now: read, decide, control, publish."""
        lease, reporter = self._parts.lease, self._reporter
        self._now_s = now_s = self._bus.begin_step()
        self._limit.begin_step()
        self._step_s = self._stopwatch()
        self._estimate = None
        if self._leases.unread or not (self._speaks and lease.undisputed):
            self._tend_lease()
        self._read()
        if not lease.lost:
            self._decide()
            if self._control_by_s is not None:
                late = not self._plans_are_here()
                if not late or now_s >= self._control_by_s:
                    self._publish(self._control(late))
            if now_s >= reporter.due_s and not lease.quiet:
                reporter.report()
        self._bus.end_step(self._settings.vehicle, self._estimate, self._limit.overtime)

    def _tend_lease(self) -> None:
        """Ask for a lease as long as there is none, and speak for the vehicle from then on."""
        parts, vehicle, now_s = self._parts, self._settings.vehicle, self._now_s
        lease = parts.lease
        for received in self._leases.drain():
            answer = received.message
            lease.hear(answer.agent, answer.number, answer.commanding, now_s)
        if lease.bid_due(now_s):
            take_over = lease.takes_over(now_s, self._pilot.ready)
            bid = LeaseBid(agent=lease.agent, host=self._settings.bus.host or None, take_over=take_over)
            self._bus.publish(channels.LEASE_BID, vehicle, bid)
        if lease.held and not self._speaks:
            self._speaks = True
            # What is asked of an agent that has just restarted in flight waits until it knows that it flies.
            self._answer_from_s = now_s + ORIENTATION_S
            self._bus.serve(vehicle, parts.requests.verbs)
            self._bus.announce(vehicle, "agent")
            self._reporter.begin()

    def _read(self) -> None:
        """Take in requests, what the transmitter applied, and where the motion capture sees the vehicle.

        Several times in a period nearly all of it has nothing new: parts are asked only where there is.
        """
        parts, now_s = self._parts, self._now_s
        observation, handover = parts.observation, parts.handover
        if self._bus.requests or parts.requests.waiting:
            self._take_requests()
        found_flying = bool(observation.applied.unread) and observation.take_applied()
        resumes = bool(handover.intents.unread) and handover.hear()
        if (resumes or found_flying) and handover.resume():
            parts.changes.keep_leaders()
            parts.lost.expect()
        if observation.poses.unread or now_s >= parts.pacing.overdue_at_s:
            for began_s in observation.frames(now_s):
                self._begin_period(began_s)

    def _take_requests(self) -> None:
        """Answer requests, as soon as it is known whether the vehicle flies."""
        oriented = self._pilot.informed or self._now_s >= self._answer_from_s
        if not oriented or self.lost:
            return
        incoming, self._bus.requests = self._bus.requests, []
        if self._parts.requests.take(incoming):
            self._reporter.soon()

    def _decide(self) -> None:
        """Settle what was waiting for a leader's plan, or for work that is done ahead."""
        parts, events = self._parts, self._bus.events
        news = parts.changes.settle()
        if events:
            news |= TUNED in events and parts.requests.settle_tuning()
            news |= TRAJECTORY_CHECKED in events and parts.requests.trajectories.settle()
        if events or parts.relief.launcher.unread:
            news |= parts.relief.settle()
        if news or parts.tuning.note_replaced():
            self._reporter.soon()

    def _begin_period(self, now_s: float) -> None:
        """Change leaders at this frame if it was agreed, and say until when the period waits for plans."""
        parts, pilot = self._parts, self._pilot
        parts.changes.begin_due()
        if not pilot.informed:
            return
        pacing, frame, flying = parts.pacing, pilot.clock.current_frame, pilot.guidance.rotor_on
        if pacing.control_due(frame, flying):
            pacing.on_begin(pilot.clock.epoch, frame, flying)
            self._began_s = now_s
            self._control_by_s = now_s + self._longest_wait_s()
        elif pacing.left_out(frame):
            pilot.fly_as_planned()

    def _longest_wait_s(self) -> float:
        """How long the period may wait for plans: every leader above this vehicle takes its time."""
        guidance = self._pilot.guidance
        if not guidance.follows:
            return 0.0
        level = self._parts.plans.level(link.leader for link in guidance.followed)
        return min(level * self._settings.leader_wait_s, LARGEST_WAITING_SHARE * self._settings.period_s)

    def _plans_are_here(self) -> bool:
        parts, clock, followed = self._parts, self._pilot.clock, self._pilot.guidance.followed
        if not followed:
            return True
        frame = parts.pacing.plan_frame(clock.current_frame)
        return parts.plans.complete(clock.epoch, frame, [link.leader for link in followed])

    def _control(self, late: bool) -> ControlOutput:
        """Fly one control period; `late` tells that a plan of this frame is missing."""
        parts, pilot = self._parts, self._pilot
        self._control_by_s = None
        parts.pacing.on_command()
        if late and pilot.guidance.follows:
            pilot.fallbacks["leader_plan_late"] += 1
        plans = parts.plans.plans(pilot.clock, parts.changes.cycles_from)
        if parts.lost.tend(plans):
            parts.changes.keep_leaders()
        if parts.external.client or parts.external.answers.unread:
            parts.external.before_control()
        known = pilot.estimate
        self._estimate = [*known.motion.tolist(), *known.actuator.tolist(), *known.disturbance.tolist()]
        started_s = self._stopwatch()
        output = pilot.control(plans, parts.traffic.neighbours(pilot.clock, plans))
        ready_s = self._stopwatch()
        parts.solve.add(ready_s - started_s)
        self._timing = timing_of(self._settings, pilot, parts.observation.seen, started_s, ready_s)
        return output

    def _publish(self, output: ControlOutput) -> None:
        """Publish command and plan, and do what has time until they are on their way."""
        parts, guidance = self._parts, self._pilot.guidance
        # Followers wait for the plan of a leader, so that goes first; other vehicles send the command first.
        if guidance.follows:
            self._publish_command(output)
            self._publish_plan(output)
        else:
            self._publish_plan(output)
            self._publish_command(output)
        # Until the step began by the clock that stands still in it, and since then.
        waited_s = self._now_s - self._began_s
        parts.relief.watch(waited_s + self._stopwatch() - self._step_s, guidance.rotor_on)
        if parts.external.client:
            parts.external.after_control()
        if parts.pacing.every == 1:
            # At another rate an oscillation would look like a slower one.
            parts.guard.watch(output, flown_by_own=not parts.external.client)
        if self._reporter.said is not None and parts.traffic.due():
            parts.traffic.tend(self._reporter.said, parts.peers.statuses())

    def _publish_command(self, output: ControlOutput) -> None:
        lease = self._parts.lease.number
        command = command_message(self._settings, self._pilot, output, lease, self._timing)
        self._bus.publish(channels.COMMAND, self._settings.vehicle, command)

    def _publish_plan(self, output: ControlOutput) -> None:
        plan = plan_message(self._settings, self._pilot, output, self._parts.plans)
        self._bus.publish(channels.PLAN, self._settings.vehicle, plan)

    def wait_for_work(self) -> None:
        """Wait for what is done ahead in threads; for a replay, which is told by the log when that was."""
        self._parts.tuning.wait()
        self._parts.requests.trajectories.wait()

    def beat(self, heartbeat: Heartbeat) -> None:
        """Show the supervisor that the loop has come round, and whether the rotor turns."""
        heartbeat.beat(self._pilot.guidance.rotor_on)

    @property
    def rest_until_s(self) -> float:
        """Until when messages can wait, because control periods are left out [monotonic s]."""
        pacing, seen = self._parts.pacing, self._parts.observation.seen
        if pacing.every == 1 or seen is None or self._control_by_s is not None:
            return -math.inf
        return seen.arrived_s + pacing.rest_s(self._pilot.clock.current_frame)

    def next_s(self) -> float:
        """Time of the next deadline [monotonic s]; messages wake the loop earlier."""
        parts, lease, reporter = self._parts, self._parts.lease, self._reporter
        if parts.requests.waiting:
            return -math.inf
        if self._control_by_s is not None:
            return self._control_by_s
        next_s = parts.pacing.overdue_at_s
        if not lease.undisputed:
            next_s = min(next_s, lease.next_s())
        return next_s if lease.quiet else min(next_s, reporter.due_s)


def run_agent(settings: AgentSettings, pilot: Pilot) -> bool:
    """Run the agent of one vehicle until SIGTERM or SIGINT, or until another agent flies the vehicle.

    Parameters
    ----------
    settings
        The vehicle's settings.
    pilot
        Its pilot, built from the same settings; a spare process has it ready.

    Returns
    -------
    bool
        Whether another agent flies the vehicle now.

    Raises
    ------
    BusUnreachableError
        No router answers.
    """
    signals, wake = list[int](), threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda number, _: signals.append(number))
    realtime = request_realtime(settings.realtime_priority)
    with Session(settings.bus, wake=wake.set) as session:
        agent = Agent(settings, pilot, SteppedSession(session), realtime, limit=AlarmTimeLimit())
        heartbeat = own_heartbeat()
        settle()
        while not (signals or agent.lost):
            agent.beat(heartbeat)
            rest_until_s = agent.rest_until_s
            if rest_until_s > -math.inf and (rest_s := rest_until_s - session.clock()) > 0.0:
                time.sleep(rest_s)
            wake.wait(max(0.0, min(agent.next_s() - session.clock(), LONGEST_WAIT_S)))
            wake.clear()
            agent.step()
        heartbeat.ending()
        return agent.lost
