"""Takeover of a vehicle: the lease, and the intent of a predecessor, from which its successor continues.

The launcher of its host has the predecessor's intent. While the predecessor still flies, the successor
receives its intents, so that no request to it is lost.
"""

import math
from typing import Final

import numpy as np
from msgspec.structs import replace

from rcopterx.agents.flight.guidance import Task
from rcopterx.agents.flight.timeline import FleetClock
from rcopterx.agents.following.leader_plans import followed_leader, target_link
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.tuning.changes import Tuning
from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.bus import channels
from rcopterx.bus.intent import Intent, OffsetMove
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import LeaseBid, SetPoint, ZoneSet
from rcopterx.bus.requests import Recall, RecallReply
from rcopterx.bus.session import RequestFailedError
from rcopterx.bus.stepping import StepBus
from rcopterx.control.references import set_points
from rcopterx.control.references.paths import FlightPath
from rcopterx.formation.law import FollowedLeader, FormationOffset
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import YAW, three

BID_PERIOD_S: Final = 0.01  # time between two bids; a lost one must not cost a control period
EAGER_S: Final = 1.0
LATER_BID_PERIOD_S: Final = 0.1  # time between two bids of an agent that has bid for longer than `EAGER_S`
WARM_S: Final = 2.0  # for which an agent watches the vehicle before it takes it over
REFUSED_S: Final = 0.5  # an agent that is refused for so long ends: another one flies its vehicle
IGNORED_S: Final = 0.3  # commands without effect for so long are of a lease that the gateway forgot


class ControlLease:
    """Permission to command a vehicle, granted by its transmitter gateway; times are monotonic [s]."""

    def __init__(self, agent: int, take_over: bool, now_s: float) -> None:
        self.agent = agent
        self.take_over = take_over
        self.number = 0  # the lease; 0 before there is one
        self.lost = False  # whether another agent commands, so that this one has to end
        self._began_s = now_s
        self._bid_at_s = now_s
        self._refused_since_s: float | None = None
        self._ignored_since_s: float | None = None

    @property
    def held(self) -> bool:
        """Whether the agent may command."""
        return self.number > 0 and not self.lost

    @property
    def quiet(self) -> bool:
        """Whether another agent publishes the status of the vehicle, as far as is known."""
        return not self.held and (self.lost or self.take_over or self._refused_since_s is not None)

    def on_answer(self, agent: int, number: int, commanding: int, now_s: float) -> None:
        """Process an answer to a bid of any agent: its lease, 0 for none, and the lease in force."""
        if agent == self.agent:
            if number:
                self.number, self._refused_since_s, self._ignored_since_s = number, None, None
            elif not self.held:
                if self._refused_since_s is None:
                    self._refused_since_s = now_s
                elif now_s - self._refused_since_s >= REFUSED_S and not self.take_over:
                    self.lost = True
        self._lose_to(commanding)

    def note_applied(self, commanding: int, now_s: float) -> None:
        """Process which lease was in force when a serial frame was written."""
        self._lose_to(commanding)
        if not self.held or commanding == self.number:
            self._ignored_since_s = None
        elif self._ignored_since_s is None:
            self._ignored_since_s = now_s

    def _lose_to(self, commanding: int) -> None:
        if self.number and commanding > self.number:
            self.lost = True

    def bid_due(self, now_s: float) -> bool:
        """Return whether to send a bid now, as long as there is no answer."""
        since_s = self._ignored_since_s
        ignored = since_s is not None and now_s - since_s >= IGNORED_S
        if self.lost or now_s < self._bid_at_s or (self.number and not ignored):
            return False
        eager = now_s - self._began_s < EAGER_S
        self._bid_at_s = now_s + (BID_PERIOD_S if eager else LATER_BID_PERIOD_S)
        return True

    def takes_over(self, now_s: float, ready: bool) -> bool:
        """Return whether to bid for the lease of an agent that commands; `ready`: the vehicle is seen."""
        return self.take_over and ready and now_s - self._began_s >= WARM_S

    def next_s(self) -> float:
        """Return when the next bid is due."""
        return math.inf if self.number or self.lost else self._bid_at_s


def intent_of(
    lease: int,
    task: Task,
    configuration: Configuration,
    previous: Configuration | None,
    clock: FleetClock,
    yaw_rad: float | None,
    zones: ZoneSet | None = None,
) -> Intent:
    """Return the task of a vehicle as a message; `task_of` makes the same task of it at any later moment.

    `previous` was before the last change. `yaw_rad` has all turns; None before the vehicle has been seen.
    """
    time_s = clock.time_s
    path = task.source if isinstance(task.source, set_points.TimedPath) else None
    suspended = path if isinstance(path, set_points.SuspendedPath) else None
    kind = type(path) if suspended is None else suspended.kind
    end_m, end_yaw_rad = task.source.end()
    return Intent(
        lease=lease,
        phase=task.phase.value,
        epoch=clock.epoch,
        frame=clock.current_frame,
        yaw_rad=yaw_rad,
        set_point=SetPoint(position_m=three(end_m), yaw_rad=end_yaw_rad),
        path=None if path is None else FloatArray.of(path.path.knots),
        path_elapsed_s=0.0 if path is None else time_s - path.start_s,
        floor_m=task.floor_m,
        interrupted=None if task.interrupted is None else task.interrupted.value,
        assigned=tuple(target_link(link) for link in task.assigned),
        following=tuple(link.leader for link in task.followed),
        joined=tuple(sorted(task.joined)),
        moves=tuple(
            OffsetMove(
                leader=link.leader,
                start_offset_m=three(link.start.position_m),
                start_yaw_offset_rad=link.start.yaw_rad,
                elapsed_s=time_s - link.start_s,
                duration_s=link.duration_s,
            )
            for link in task.followed
            if link.start is not None and time_s < link.start_s + link.duration_s
        ),
        flown_by=configuration.message,
        previous=None if previous is None else previous.message,
        path_requested=kind is set_points.PathReference,
        rest=None if suspended is None else FloatArray.of(suspended.rest.knots),
        home_m=task.home_m,
        zones=zones,
    )


def task_of(intent: Intent, time_s: float, passed_s: float) -> Task:
    """Return the task of a predecessor, `passed_s` after its publication, on the clock of its successor."""
    published_s = time_s - passed_s
    source: set_points.ReferenceSource = set_points.SetPointReference(
        np.array(intent.set_point.position_m), intent.set_point.yaw_rad
    )
    if intent.path is not None:
        kind = set_points.PathReference if intent.path_requested else set_points.ProfileTransition
        path, start_s = FlightPath(intent.path.to_numpy()), published_s - intent.path_elapsed_s
        source = kind(path, start_s)
        if intent.rest is not None:
            source = set_points.SuspendedPath(path, start_s, FlightPath(intent.rest.to_numpy()), kind)
    assigned = followed = tuple(followed_leader(link) for link in intent.assigned)
    joined: frozenset[str] = frozenset()
    if intent.following == tuple(link.leader for link in assigned):
        moves = {move.leader: move for move in intent.moves}
        followed = tuple(_moving(link, moves.get(link.leader), published_s) for link in assigned)
        joined = frozenset(intent.joined)
    # Else others replaced lost leaders; the successor decides again whether they still have to.
    phase, stopped = Phase(intent.phase), None if intent.interrupted is None else Phase(intent.interrupted)
    return Task(phase, source, followed, assigned, joined, intent.floor_m, stopped, home_m=intent.home_m)


def passed_s(intent: Intent, age_s: float, clock: FleetClock) -> float:
    """Return the time since an intent was published: by frames, across epochs by its age."""
    frames = clock.current_frame - intent.frame
    return frames * clock.period_s if clock.epoch == intent.epoch else age_s


def _moving(link: FollowedLeader, move: OffsetMove | None, published_s: float) -> FollowedLeader:
    if move is None:
        return link
    start = FormationOffset(np.array(move.start_offset_m), move.start_yaw_offset_rad, link.target.frame)
    return FollowedLeader(
        link.leader, link.target, link.weight, start, published_s - move.elapsed_s, move.duration_s
    )


LATE_INTENT_S: Final = 0.5  # time after a handover in which intents of the predecessor still count
LONG_PERIOD_S: Final = 1.0  # publication period of an unchanged intent with a path, which is long
RECALL_TIMEOUT_S: Final = 0.2
RECENT_TAKE_OFF_S: Final = 1.5  # largest age of an intent whose take-off from the floor begins again
PREVIOUS_AFTER: Final = 1  # quick deaths after which the last change of configuration is withdrawn
DEFAULTS_AFTER: Final = 2  # quick deaths after which the default controller and estimator fly


class Handover:
    """Handover of one agent."""

    def __init__(self, bus: StepBus, settings: AgentSettings, pilot: Pilot, tuning: Tuning) -> None:
        self._bus = bus
        self.lease = ControlLease(bus.life, settings.take_over, bus.clock())
        self._vehicle, self._host = settings.vehicle, settings.bus.host
        self._intents = bus.subscribe(channels.INTENT, self._vehicle, depth=4, waking=False)
        self._answers = bus.subscribe(channels.LEASE, self._vehicle, depth=16)
        self._resumed_s: float | None = None
        self._pilot = pilot
        self._tuning = tuning
        self._published: Intent | None = None
        self._published_s = 0.0
        self.predecessor: Intent | None = None  # last intent of the vehicle's previous agent, if any
        self._predecessor_s = 0.0
        self._quick_deaths = 0
        self._recall()
        if self._quick_deaths >= DEFAULTS_AFTER:
            # Before the first step: the configuration of the fleet file may be what ends the process.
            tuning.use_defaults(
                f"the agent died {self._quick_deaths + 1} times in a row; the default controller flies until "
                "one is chosen"
            )
        if self.predecessor is not None and self.predecessor.yaw_rad is not None:
            pilot.estimation.expected_yaw_rad = self.predecessor.yaw_rad

    def _recall(self) -> None:
        """Request the last intent of the predecessor, its age, and the number of quick deaths."""
        try:
            reply = self._bus.request(
                self._host, Recall(vehicle=self._vehicle), timeout_s=RECALL_TIMEOUT_S, patience_s=0.0
            )
        except RequestFailedError:
            return
        if isinstance(reply, RecallReply):
            self.predecessor, self._predecessor_s = reply.intent, self._bus.clock() - reply.age_s
            self._quick_deaths = reply.quick_deaths

    def bid(self, now_s: float) -> None:
        """Bid for the lease until the agent holds one."""
        lease = self.lease
        for received in self._answers.drain():
            answer = received.message
            lease.on_answer(answer.agent, answer.number, answer.commanding, now_s)
        if lease.bid_due(now_s):
            take_over = lease.takes_over(now_s, self._pilot.ready)
            bid = LeaseBid(agent=lease.agent, host=self._host or None, take_over=take_over)
            self._bus.publish(channels.LEASE_BID, self._vehicle, bid)

    def receive_intents(self) -> bool:
        """Process intents of a predecessor that still flies; return whether to resume again."""
        again = False
        for received in self._intents.drain():
            intent = received.message
            if intent.lease == self.lease.number:
                continue  # published by this agent
            late = self._resumed_s is not None
            if late and received.arrived_s - (self._resumed_s or 0.0) > LATE_INTENT_S:
                continue
            before, self.predecessor = self.predecessor, intent
            self._predecessor_s = received.arrived_s
            if not self.lease.held:
                self._restore_configuration(intent)
            again = again or (late and before is not None and _content(before) != _content(intent))
        return again

    def resume(self) -> bool:
        """Continue the task of the predecessor, in flight; return False without one."""
        intent, clock = self.predecessor, self._pilot.clock
        self._resumed_s = self._bus.clock()
        if intent is None:
            return False
        self._restore_configuration(intent)
        task = task_of(intent, clock.time_s, self._passed_s(intent))
        self._pilot.guidance.restore(task, self._pilot.estimate, clock.time_s)
        return True

    def resume_take_off(self) -> None:
        """Begin the take-off of a predecessor again, if it ended while the armed vehicle still stood."""
        intent, pilot = self.predecessor, self._pilot
        if intent is None or pilot.guidance.task.phase is not Phase.ARMED:
            return
        if Phase.TAKEOFF in (intent.phase, intent.interrupted) and self._passed_s(intent) < RECENT_TAKE_OFF_S:
            pilot.take_off(intent.set_point.position_m[2] - intent.floor_m)

    def _passed_s(self, intent: Intent) -> float:
        """Time since the predecessor published an intent [s]."""
        return passed_s(intent, self._bus.clock() - self._predecessor_s, self._pilot.clock)

    def _restore_configuration(self, intent: Intent) -> None:
        """Restore the configuration of the predecessor, unless it is what ends the process."""
        if self._quick_deaths >= DEFAULTS_AFTER:
            return
        wanted = Configuration.reported(intent.flown_by)
        if self._quick_deaths >= PREVIOUS_AFTER and intent.previous is not None:
            wanted = Configuration.reported(intent.previous)
            self._tuning.remark = (
                f"the agent died {self._quick_deaths + 1} times in a row; the last change of controller or "
                "settings is withdrawn"
            )
        elif intent.previous is not None:
            self._tuning.previous = Configuration.reported(intent.previous)
        self._tuning.restore(wanted)

    def publish(self, now_s: float, zones: ZoneSet | None = None) -> None:
        """Publish the present intent; called with every status."""
        clock = self._pilot.clock
        yaw_rad = float(self._pilot.estimate.motion[YAW]) if clock.started else None
        task, tuning = self._pilot.guidance.task, self._tuning
        intent = intent_of(self.lease.number, task, tuning.intended, tuning.previous, clock, yaw_rad, zones)
        content = _content(intent)
        recent = now_s - self._published_s < LONG_PERIOD_S
        if intent.path is not None and content == self._published and recent:
            return
        self._published, self._published_s = content, now_s
        self._bus.publish(channels.INTENT, self._vehicle, intent)


def _content(intent: Intent) -> Intent:
    """Return an intent without the fields that change with time alone."""
    return replace(intent, lease=0, epoch=0, frame=0, yaw_rad=None, path_elapsed_s=0.0, moves=())
