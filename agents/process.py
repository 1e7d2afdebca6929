"""The agent process: read poses and plans, call the pilot, publish plan and command."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Final

import numpy as np

from rcopterx.agents.cooperation import Sent
from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.following.following import Following
from rcopterx.agents.guards.time_limit import AlarmTimeLimit, NotedTimeLimit, TimeLimit
from rcopterx.agents.load import Pacing, Relief
from rcopterx.agents.pilot import ControlOutput, Pilot
from rcopterx.agents.relief import LoadRelief
from rcopterx.agents.reporting import Reporter, command_message, plan_message, timing_of
from rcopterx.agents.requests.external_control import ExternalControl
from rcopterx.agents.requests.request_handler import RequestHandler
from rcopterx.agents.scheme_messages import LaterExchanges, newest_messages, scheme_message
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.takeover import Handover
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.guard import OscillationGuard
from rcopterx.bus import channels
from rcopterx.bus.heartbeat import LONGEST_WAIT_S, own_heartbeat
from rcopterx.bus.messages import CommandTiming, Pose
from rcopterx.bus.realtime import ending_signals, prepare_loop, request_realtime
from rcopterx.bus.session import Session
from rcopterx.bus.stepping import StepBus
from rcopterx.bus.subscription import Inbox, Received
from rcopterx.control.interfaces import Measurement

OF_ANOTHER_AGENT: Final = -1  # sequence of no command of this agent
ORIENTATION_S = 0.5
"""Longest time after the start in which requests wait for the state of the transmitter."""
TUNED: Final = "tuned"  # event of the thread that prepares another controller
TRAJECTORY_CHECKED: Final = "trajectory_checked"  # event of the thread that checks a trajectory


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
        pilot.step_guard.calls.limit = pilot.estimator.calls.limit = self._limit
        self._build_parts(realtime)
        self.serving_since_s = math.inf
        """Since when the agent accepts requests for the vehicle [monotonic s]; infinite before."""
        self.seen: Received[Pose] | None = None  # newest pose that the pilot accepted; None before the first
        self.control_by_s: float | None = None
        """Time by which the present control period has to be flown [monotonic s]; None if that is done."""
        self._period_began_s = 0.0
        """When the pose of the present control period arrived."""
        self._now_s = 0.0
        """Time of the present step."""

    def _build_parts(self, realtime: bool) -> None:
        """Build the parts beside the pilot. Replays find a subscription by its number: its order counts."""
        settings, pilot, bus = self._settings, self._pilot, self._bus
        vehicle, host = settings.vehicle, settings.bus.host
        self.pacing = Pacing(settings.period_s, settings.vehicles.index(vehicle))
        self.poses = bus.subscribe(channels.POSE, vehicle, depth=32)
        # It counts from the next pose on: waking up for it would double the steps of a leader.
        self.applied = bus.subscribe(channels.APPLIED, vehicle, depth=16, waking=False)
        self.following = Following(settings, pilot, bus)
        self.tuning = Tuning(settings.configuration, pilot, settings.period_s, partial(bus.note, TUNED))
        self._guard = OscillationGuard(pilot, self.tuning)
        external_inputs = bus.subscribe(channels.EXTERNAL_INPUT, vehicle, depth=8, waking=False)
        publish_task = partial(bus.publish, channels.CONTROL_TASK, vehicle)
        self._external = ExternalControl(pilot, external_inputs, publish_task)
        wake = partial(bus.note, TRAJECTORY_CHECKED)
        following = self.following
        self._requests = RequestHandler(
            settings, pilot, following.changes, following.peers, self.tuning, self._external, wake
        )
        launcher = bus.subscribe(channels.LAUNCHER, host, waking=False) if host else Inbox(channels.LAUNCHER)
        self.relief = LoadRelief(
            bus, settings.period_s, self.pacing, following.traffic, launcher, pilot.events
        )
        self.handover = Handover(bus, settings, pilot, self.tuning)
        self._scheme_messages = bus.subscribe_all(channels.SCHEME, waking=False)
        self._later_exchanges = LaterExchanges(pilot.cooperation)
        parts = (following, self._external, self.relief, self._guard)
        inboxes = (self.poses, self.applied, external_inputs)
        self._reporter = Reporter(settings, pilot, bus, self.tuning, parts, inboxes, realtime)

    @property
    def lost(self) -> bool:
        """Whether another agent flies the vehicle now, so that this one has to end."""
        return self.handover.lease.lost

    def step(self) -> None:
        """Do everything that is due now: update, decide, control, publish."""
        # Set before the input is collected, so that a plan that arrives just afterwards wakes this process.
        plans = self.following.plans
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
                self._send(self._later_exchanges.exchange(self._scheme_messages))
            # Nothing delays a command.
            if self.control_by_s is None and self._now_s >= self._reporter.due_s:
                self._report()
        self._bus.end_step(self._settings.vehicle, estimate, self._limit.overtime)
        if self.control_by_s is None:
            plans.awaited = self.following.changes.waiting

    def _report(self) -> None:
        """Publish status and intent, unless another agent does."""
        predecessor, room = self.handover.predecessor, self.following.room
        self._requests.adopt_zones(None if predecessor is None else predecessor.zones)
        if self.handover.lease.quiet:
            return
        relief, now_s = self.relief, self._now_s
        sparse, late_share = relief.relief >= Relief.REPORTS, relief.overload.late_share
        mode = self.following.lost.following_mode
        self._reporter.report(now_s, sparse, mode, self.poses.age_s(now_s), late_share, room.zones)
        self.handover.publish(now_s, room.zones)

    def _update(self) -> None:
        """Process what has arrived: the lease, requests, the state of the transmitter, poses."""
        handover = self.handover
        self._update_lease()
        self._take_requests()
        was_informed = self._pilot.informed
        found_flying = self._take_applied()
        other_intent = handover.receive_intents()
        if (found_flying or other_intent) and handover.resume():
            self.following.resume()
        elif self._pilot.informed and not was_informed:
            handover.resume_take_off()
        for began_s in self._frames():
            self._begin_period(began_s)

    def _update_lease(self) -> None:
        """Bid for the lease until the agent holds one; begin to serve the vehicle then."""
        self.handover.bid(self._now_s)
        if self.handover.lease.held and self.serving_since_s == math.inf:
            self.serving_since_s = self._now_s
            self._bus.serve(self._settings.vehicle, self._requests.verbs)
            self._reporter.begin()

    def _take_requests(self) -> None:
        """Answer requests, as soon as it is known whether the vehicle flies."""
        oriented = self._pilot.informed or self._now_s >= self.serving_since_s + ORIENTATION_S
        if oriented and not self.lost:
            incoming, self._bus.requests = self._bus.requests, []
            if self._requests.take(incoming):
                self._reporter.request_report()

    def _decide(self) -> None:
        """Apply what requests and threads have prepared; request a report if anything has changed."""
        events = self._bus.events
        news = [
            self.following.changes.decide(),
            TUNED in events and self._requests.finish_tuning(),
            TRAJECTORY_CHECKED in events and self._requests.trajectories.finish(),
            self.relief.update(),
            self.tuning.note_replaced(),
        ]
        if any(news):
            self._reporter.request_report()

    def _take_applied(self) -> bool:
        """Process the inputs written to the radio; return whether the vehicle is found in flight."""
        pilot, lease, guidance = self._pilot, self.handover.lease, self._pilot.guidance
        was_flying = guidance.rotor_on
        for received in self.applied.drain():
            applied = received.message
            lease.note_applied(applied.lease, self._now_s)
            if not lease.held:
                pilot.watch(applied.state, np.array(applied.input))
                continue
            sequence = applied.sequence if applied.lease == lease.number else OF_ANOTHER_AGENT
            pilot.note_applied(applied.state, sequence, np.array(applied.input))
        return guidance.rotor_on and not was_flying

    def _frames(self) -> Iterator[float]:
        """Give frames to the pilot; yield when each began [monotonic s]; late ones only update estimates."""
        pilot, pacing = self._pilot, self.pacing
        for received in self.poses.drain():
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
        pilot = self._pilot
        self.following.changes.apply_prepared()
        if not pilot.informed:
            return
        pacing, frame, flying = self.pacing, pilot.clock.current_frame, pilot.guidance.rotor_on
        if pacing.control_due(frame, flying):
            pacing.on_begin(pilot.clock.epoch, frame, flying)
            self._period_began_s = began_s
            self.control_by_s = began_s + self.following.longest_wait_s()
        elif pacing.left_out(frame):
            pilot.fly_as_planned()

    def _control_is_due(self) -> bool:
        by_s = self.control_by_s
        return by_s is not None and (self._plans_are_here() or self._now_s >= by_s)

    def _plans_are_here(self) -> bool:
        clock = self._pilot.clock
        frame = self.pacing.plan_frame(clock.current_frame)
        return self.following.plans.complete(clock.epoch, frame, self._pilot.guidance.awaited)

    def _control(self) -> tuple[ControlOutput, list[float], CommandTiming | None]:
        """Fly the present control period; return also the estimate before it and the stages it passed."""
        pilot = self._pilot
        self.control_by_s, self.following.plans.awaited = None, False
        self.pacing.on_command()
        if pilot.guidance.follows and not self._plans_are_here():
            pilot.events["leader_plan_late"] += 1
        plans, neighbours = self.following.for_control()
        self._external.before_control()
        motion, actuator, disturbance, _ = pilot.estimate
        estimate = [*motion.tolist(), *actuator.tolist(), *disturbance.tolist()]
        began_s = self._stopwatch()
        schemes = pilot.cooperation
        received = {} if schemes.scheme is None else newest_messages(self._scheme_messages, schemes)
        output = pilot.control(plans, neighbours, received)
        ready_s = self._stopwatch()
        self.relief.solve_ms.append(1000 * (ready_s - began_s))
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
        settings, lease = self._settings, self.handover.lease.number
        command = command_message(settings, self._pilot, output, lease, timing)
        self._bus.publish(channels.COMMAND, settings.vehicle, command)

    def _publish_plan(self, output: ControlOutput) -> None:
        plan = plan_message(self._settings, self._pilot, output, self.following.plans)
        self._bus.publish(channels.PLAN, self._settings.vehicle, plan)

    def _after_control(self, output: ControlOutput, step_s: float) -> None:
        """Do what can wait until the command of the period is under way."""
        late_s = self.pacing.pose_delay_s + self._now_s - self._period_began_s + step_s
        self.relief.watch(late_s, self._pilot.guidance.rotor_on)
        self._external.after_control()
        if self.pacing.every == 1:
            # At another rate an oscillation would look like a slower one.
            self._guard.watch(output, flown_by_own=not self._external.client)
        self.following.after_control(self._reporter.last_status)

    def wait_for_work(self) -> None:
        """Wait for the threads of the agent: in lockstep, and in a replay, whose log says when they ended."""
        self.tuning.wait()
        self._requests.trajectories.wait()

    def turn(self, session: Session) -> None:
        """Wait for a message or a deadline, and do what is due."""
        now_s = session.clock()
        rest_s = max(0.0, self.rest_until_s - now_s)
        session.wait(min(self.next_s() - now_s, rest_s + LONGEST_WAIT_S), rest_s=rest_s)
        self.step()

    @property
    def rest_until_s(self) -> float:
        """Until when messages can wait, because control periods are left out [monotonic s]."""
        pacing, seen = self.pacing, self.seen
        if pacing.every == 1 or seen is None or self.control_by_s is not None:
            return -math.inf
        return seen.arrived_s + pacing.rest_s(self._pilot.clock.current_frame)

    def next_s(self) -> float:
        """Time of the next deadline [monotonic s]; reports wait for the next step."""
        if self._requests.waiting:
            return -math.inf
        if self.control_by_s is not None:
            return self.control_by_s
        return min(self.pacing.overdue_at_s, self.handover.lease.next_s(), self._later_exchanges.due_s)


def run_agent(settings: AgentSettings, pilot: Pilot) -> bool:
    """Run the agent of one vehicle until SIGTERM or SIGINT, or until another agent flies the vehicle.

    Returns whether another agent flies it now. Raises `BusUnreachableError`: no router answers.
    """
    signals = ending_signals()
    realtime = request_realtime(settings.realtime_priority)
    with Session(settings.bus) as session:
        agent = Agent(
            settings, pilot, StepBus(session), realtime, limit=AlarmTimeLimit(settings.bus.clock.speed)
        )
        session.finish_first(agent.wait_for_work)
        heartbeat = own_heartbeat()
        prepare_loop()
        while not (signals or agent.lost):
            heartbeat.beat(pilot.guidance.rotor_on)
            agent.turn(session)
        heartbeat.ending()
        return agent.lost
