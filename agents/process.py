"""The agent process: read poses and plans, call the pilot, publish plan and command."""

import math
import signal
from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from rcopterx.agents.assembly import TRAJECTORY_CHECKED, TUNED, AgentParts
from rcopterx.agents.cooperation import Sent
from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.guards.time_limit import AlarmTimeLimit, NotedTimeLimit, TimeLimit
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.reporting import Reporter, command_message, plan_message, timing_of
from rcopterx.agents.scheme_messages import LaterExchanges, newest_messages, scheme_message
from rcopterx.agents.settings import AgentSettings
from rcopterx.bus import channels
from rcopterx.bus.heartbeat import LONGEST_WAIT_S, own_heartbeat
from rcopterx.bus.messages import CommandTiming, LeaseBid, Pose
from rcopterx.bus.realtime import prepare_loop, request_realtime
from rcopterx.bus.session import Session
from rcopterx.bus.stepping import StepBus, SteppedSession
from rcopterx.bus.subscription import Received
from rcopterx.control.interfaces import Measurement

OF_ANOTHER_AGENT: Final = -1  # sequence of no command of this agent
ORIENTATION_S = 0.5
"""Longest time after the start in which requests wait for the state of the transmitter."""
LARGEST_WAITING_SHARE = 0.5
"""Largest share of a control period that a follower far down the line waits for plans."""


class Agent:
    """One vehicle's agent on the bus. The same inputs at the same steps give the same result.

    `stopwatch` is a clock of the fleet [s] that goes on during a step, for the duration of control steps, by
    default that of the settings. `limit` is the time limit of calls of controllers and estimators, if any.
    """

    def __init__(
        self,
        settings: AgentSettings,
        pilot: Pilot,
        bus: StepBus,
        realtime: bool,
        stopwatch: Callable[[], float] | None = None,
        limit: TimeLimit | None = None,
    ) -> None:
        self._settings, self._pilot, self._bus = settings, pilot, bus
        self._stopwatch = stopwatch or settings.bus.clock.now
        self._limit = NotedTimeLimit(limit or TimeLimit())
        pilot.limit_time(self._limit)
        self.parts = AgentParts(settings, pilot, bus)
        """The parts of the agent beside its pilot."""
        self._reporter = Reporter(settings, pilot, bus, self.parts, realtime)
        self.serving_since_s = math.inf
        """Since when the agent accepts requests for the vehicle [monotonic s]; infinite before."""
        self.seen: Received[Pose] | None = None  # newest pose that the pilot accepted; None before the first
        self.control_by_s: float | None = None
        """Time by which the present control period has to be flown [monotonic s]; None if that is done."""
        self._later_exchanges = LaterExchanges(pilot.cooperation)
        self._period_began_s = 0.0
        """When the pose of the present control period arrived."""
        self._now_s = 0.0
        """Time of the present step."""

    @property
    def lost(self) -> bool:
        """Whether another agent flies the vehicle now, so that this one has to end."""
        return self.parts.lease.lost

    def step(self) -> None:
        """Do everything that is due now: update, decide, control, publish."""
        # Set before the input is collected, so that a plan that arrives just afterwards wakes this process.
        plans, changes = self.parts.plans, self.parts.changes
        plans.awaited = True
        self._now_s = self._bus.begin_step()
        self._limit.begin_step()
        begun_s = self._stopwatch()
        estimate = None
        plans.receive()
        self._update()
        if not self.lost:
            self._decide()
            if self._control_is_due():
                output, estimate, timing = self._control()
                self._publish(output, timing)
                self._after_control(output, self._stopwatch() - begun_s)
            elif self._now_s >= self._later_exchanges.due_s:
                self._send(self._later_exchanges.exchange(self.parts.scheme_messages))
            # Nothing delays a command.
            if (
                self.control_by_s is None
                and self._now_s >= self._reporter.due_s
                and not self.parts.lease.quiet
            ):
                self._reporter.report(self._now_s)
        self._bus.end_step(self._settings.vehicle, estimate, self._limit.overtime)
        if self.control_by_s is None:
            plans.awaited = changes.waiting

    def _update(self) -> None:
        """Process what has arrived: the lease, requests, the state of the transmitter, poses."""
        parts = self.parts
        self._update_lease()
        self._take_requests()
        was_informed = self._pilot.informed
        found_flying = self._take_applied()
        other_intent = parts.handover.receive_intents()
        if (found_flying or other_intent) and parts.handover.resume():
            parts.changes.update_subscriptions()
            parts.lost.expect()
        elif self._pilot.informed and not was_informed:
            parts.handover.resume_take_off()
        for began_s in self._frames():
            self._begin_period(began_s)

    def _update_lease(self) -> None:
        """Bid for the lease until the agent holds one; begin to serve the vehicle then."""
        parts, vehicle, now_s = self.parts, self._settings.vehicle, self._now_s
        lease = parts.lease
        for received in parts.lease_answers.drain():
            answer = received.message
            lease.on_answer(answer.agent, answer.number, answer.commanding, now_s)
        if lease.bid_due(now_s):
            take_over = lease.takes_over(now_s, self._pilot.ready)
            bid = LeaseBid(agent=lease.agent, host=self._settings.bus.host or None, take_over=take_over)
            self._bus.publish(channels.LEASE_BID, vehicle, bid)
        if lease.held and self.serving_since_s == math.inf:
            self.serving_since_s = now_s
            self._bus.serve(vehicle, parts.requests.verbs)
            self._reporter.begin()

    def _take_requests(self) -> None:
        """Answer requests, as soon as it is known whether the vehicle flies."""
        oriented = self._pilot.informed or self._now_s >= self.serving_since_s + ORIENTATION_S
        if oriented and not self.lost:
            incoming, self._bus.requests = self._bus.requests, []
            if self.parts.requests.take(incoming):
                self._reporter.request_report()

    def _decide(self) -> None:
        """Apply what requests and threads have prepared; request a report if anything has changed."""
        parts, events = self.parts, self._bus.events
        news = [
            parts.changes.decide(),
            TUNED in events and parts.requests.finish_tuning(),
            TRAJECTORY_CHECKED in events and parts.requests.trajectories.finish(),
            parts.relief.update(),
            parts.tuning.note_replaced(),
        ]
        if any(news):
            self._reporter.request_report()

    def _take_applied(self) -> bool:
        """Process the inputs written to the radio; return whether the vehicle is found in flight."""
        pilot, lease, guidance = self._pilot, self.parts.lease, self._pilot.guidance
        was_flying = guidance.rotor_on
        for received in self.parts.applied.drain():
            applied = received.message
            lease.note_applied(applied.lease, self._now_s)
            if not lease.held:
                pilot.watch(applied.state, np.array(applied.input))
                continue
            sequence = applied.sequence if applied.lease == lease.number else OF_ANOTHER_AGENT
            pilot.note_applied(applied.state, sequence, np.array(applied.input))
        return guidance.rotor_on and not was_flying

    def _frames(self) -> Iterator[float]:
        """Give new and overdue frames to the pilot; yield when each began [monotonic s].

        Poses that waited during a pause update the estimate only: commands computed from the past do not act.
        """
        pilot, pacing = self._pilot, self.parts.pacing
        for received in self.parts.poses.drain():
            pose = received.message
            measurement = None
            if pose.position_m is not None and pose.quaternion_xyzw is not None:
                measurement = Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)
            if pilot.observe(StampedMeasurement(pose.epoch, pose.frame, pose.period_s, measurement)):
                self.seen = received
                pacing.on_pose(pose.frame, received.arrived_s, pose.period_s)
                if pilot.ready and not pacing.behind:
                    yield received.arrived_s
        overdue_at_s = pacing.overdue_at_s
        if self._now_s >= overdue_at_s:
            pacing.on_coast()
            if pilot.coast():
                yield overdue_at_s

    def _begin_period(self, began_s: float) -> None:
        """Begin a control period, if this frame begins one."""
        parts, pilot = self.parts, self._pilot
        parts.changes.apply_prepared()
        if not pilot.informed:
            return
        pacing, frame, flying = parts.pacing, pilot.clock.current_frame, pilot.guidance.rotor_on
        if pacing.control_due(frame, flying):
            pacing.on_begin(pilot.clock.epoch, frame, flying)
            self._period_began_s = began_s
            self.control_by_s = began_s + self._longest_wait_s()
        elif pacing.left_out(frame):
            pilot.fly_as_planned()

    def _longest_wait_s(self) -> float:
        """Return how long the period may wait for plans: every leader above this vehicle needs its time."""
        guidance, settings = self._pilot.guidance, self._settings
        level = self.parts.plans.level(guidance.awaited) if guidance.follows else 0
        return min(level * settings.leader_wait_s, LARGEST_WAITING_SHARE * settings.period_s)

    def _control_is_due(self) -> bool:
        by_s = self.control_by_s
        return by_s is not None and (self._plans_are_here() or self._now_s >= by_s)

    def _plans_are_here(self) -> bool:
        clock = self._pilot.clock
        frame = self.parts.pacing.plan_frame(clock.current_frame)
        return self.parts.plans.complete(clock.epoch, frame, self._pilot.guidance.awaited)

    def _control(self) -> tuple[ControlOutput, list[float], CommandTiming | None]:
        """Fly the present control period; return also the estimate before it and the stages it passed."""
        parts, pilot = self.parts, self._pilot
        self.control_by_s, parts.plans.awaited = None, False
        parts.pacing.on_command()
        if pilot.guidance.follows and not self._plans_are_here():
            pilot.fallbacks["leader_plan_late"] += 1
        plans = parts.plans.plans(pilot.clock, parts.changes.cycles_from)
        if parts.lost.update(plans):
            parts.changes.update_subscriptions()
        parts.external.before_control()
        motion, actuator, disturbance, _ = pilot.estimate
        estimate = [*motion.tolist(), *actuator.tolist(), *disturbance.tolist()]
        began_s = self._stopwatch()
        schemes = pilot.cooperation
        received = {} if schemes.scheme is None else newest_messages(parts.scheme_messages, schemes)
        output = pilot.control(plans, parts.traffic.neighbours(pilot.clock, plans), received)
        ready_s = self._stopwatch()
        parts.solve_ms.append(1000 * (ready_s - began_s))
        return output, estimate, timing_of(self._settings, pilot, self.seen, began_s, ready_s)

    def _publish(self, output: ControlOutput, timing: CommandTiming | None) -> None:
        """Publish command, plan, and message of a scheme."""
        self._later_exchanges.begin_period(self._period_began_s)
        self._send(output.sent)
        # Followers wait for the plan of a leader, so that goes first; followers send the command first.
        if self._pilot.guidance.follows:
            self._publish_command(output, timing)
            self._publish_plan(output)
        else:
            self._publish_plan(output)
            self._publish_command(output, timing)

    def _send(self, sent: Sent | None) -> None:
        """Publish a message of the scheme, if there is one."""
        if sent is not None:
            vehicle, clock = self._settings.vehicle, self._pilot.clock
            message = scheme_message(sent, vehicle, clock.epoch, clock.current_frame)
            self._bus.publish(channels.SCHEME, vehicle, message)

    def _publish_command(self, output: ControlOutput, timing: CommandTiming | None) -> None:
        settings, lease = self._settings, self.parts.lease.number
        command = command_message(settings, self._pilot, output, lease, timing)
        self._bus.publish(channels.COMMAND, settings.vehicle, command)

    def _publish_plan(self, output: ControlOutput) -> None:
        plan = plan_message(self._settings, self._pilot, output, self.parts.plans)
        self._bus.publish(channels.PLAN, self._settings.vehicle, plan)

    def _after_control(self, output: ControlOutput, step_s: float) -> None:
        """Do what can wait until the command of the period is under way."""
        parts = self.parts
        late_s = parts.pacing.pose_delay_s + self._now_s - self._period_began_s + step_s
        parts.relief.watch(late_s, self._pilot.guidance.rotor_on)
        parts.external.after_control()
        if parts.pacing.every == 1:
            # At another rate an oscillation would look like a slower one.
            parts.guard.watch(output, flown_by_own=not parts.external.client)
        status = self._reporter.last_status
        if status is not None and parts.traffic.due():
            parts.traffic.update(status, parts.peers.statuses())

    def wait_for_work(self) -> None:
        """Wait for the threads of the agent: in lockstep, and in a replay, whose log says when they ended."""
        self.parts.tuning.wait()
        self.parts.requests.trajectories.wait()

    @property
    def rest_until_s(self) -> float:
        """Until when messages can wait, because control periods are left out [monotonic s]."""
        pacing, seen = self.parts.pacing, self.seen
        if pacing.every == 1 or seen is None or self.control_by_s is not None:
            return -math.inf
        return seen.arrived_s + pacing.rest_s(self._pilot.clock.current_frame)

    def next_s(self) -> float:
        """Time of the next deadline [monotonic s]; reports wait for the next step."""
        parts = self.parts
        if parts.requests.waiting:
            return -math.inf
        if self.control_by_s is not None:
            return self.control_by_s
        return min(parts.pacing.overdue_at_s, parts.lease.next_s(), self._later_exchanges.due_s)


def run_agent(settings: AgentSettings, pilot: Pilot) -> bool:
    """Run the agent of one vehicle until SIGTERM or SIGINT, or until another agent flies the vehicle.

    Returns whether another agent flies it now. Raises `BusUnreachableError`: no router answers.
    """
    signals: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda number, _: signals.append(number))
    realtime = request_realtime(settings.realtime_priority)
    with Session(settings.bus) as session:
        agent = Agent(
            settings, pilot, SteppedSession(session), realtime, limit=AlarmTimeLimit(settings.bus.clock.speed)
        )
        session.finish_first(agent.wait_for_work)
        heartbeat = own_heartbeat()
        prepare_loop()
        while not (signals or agent.lost):
            heartbeat.beat(pilot.guidance.rotor_on)
            now_s = session.clock()
            rest_s = max(0.0, agent.rest_until_s - now_s)
            session.wait(min(agent.next_s() - now_s, rest_s + LONGEST_WAIT_S), rest_s=rest_s)
            agent.step()
        heartbeat.ending()
        return agent.lost
