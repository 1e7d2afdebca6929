"""The state of a running fleet, read from the bus, and waiting for it; observing needs nothing else."""

import threading
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from rcopterx.bus import channels
from rcopterx.bus.host_messages import LauncherStatus, RouterStatus
from rcopterx.bus.log_messages import RecorderStatus
from rcopterx.bus.message import Message
from rcopterx.bus.messages import AgentStatus, Plan, Pose
from rcopterx.bus.session import Session
from rcopterx.bus.subscription import Inbox, UnitSubscriptions
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.scripting.joining import WrongFleetError, as_running, check_identity
from rcopterx.ground_station.scripting.notes import (
    capacity_notes,
    clock_differences,
    launcher_notes,
    link_notes,
    recorder_notes,
    tracker_notes,
    tracker_problems,
)
from rcopterx.ground_station.scripting.state import VehicleState, arrival_problem, formation_problem
from rcopterx.ground_station.scripting.waiting import Notifier, NotReachedError, arrived_after, begin_turns
from rcopterx.vehicles.phases import Phase

if TYPE_CHECKING:
    from rcopterx.ground_station.report.latency import LatencyWatch  # few programs watch it

M = TypeVar("M", bound=Message)

STARTED_S = 30.0  # until a fleet that was just started is ready; ArduCopter accepts arming after 20 s
FIRST_STATUS_S = 1.5  # longest wait for a first status; statuses come five times a second
UNDER_WAY_S = 0.05  # a status that arrives this soon after a call may have been sent before it
FIRST_MOTION_S = 0.5  # longest wait for a first plan or pose; they come every control period


class ObservedMotion(NamedTuple):
    """Subscriptions to poses and plans of all vehicles, and when they began [s]."""

    poses: UnitSubscriptions[Pose]
    plans: UnitSubscriptions[Plan]
    since_s: float


class Observer:
    """Reads the messages of a fleet; poses and plans only after `watch_motion`.

    `host` is the host whose router is used, by default the first one of the file; `timeout_s` is how long to
    look for the router; `clock` is monotonic [s], for ages and waits, by default that of the fleet. With a
    name as a `process` it takes turns in lockstep: time stands still while it does not wait.

    Raises
    ------
    BusUnreachableError
        No router answers: the fleet is not up.
    WrongFleetError
        The router belongs to another fleet, or to one that was started from another version of the file.
    NotReachedError
        Processes of a fleet in lockstep did not start.
    """

    def __init__(
        self,
        file: FleetFile,
        host: str | None = None,
        timeout_s: float = 3.0,
        clock: Callable[[], float] | None = None,
        process: str = "",
    ) -> None:
        self._host, self._process = host or next(iter(file.hosts)), process
        self.file = as_running(file)
        self._join(clock, timeout_s)
        if self.file is not (running := as_running(self.file)):
            # It was not up yet before its router answered.
            self.session.close()
            self.file = running
            self._join(clock, timeout_s)
        try:
            check_identity(self.session, self.file)
        except WrongFleetError:
            self.session.close()
            raise
        self._agents = self.session.subscribe_all(channels.AGENT_STATUS)
        self._transmitters = self.session.subscribe_all(channels.TRANSMITTER_STATUS)
        self._launchers = self.session.subscribe_all(channels.LAUNCHER)
        self._routers = self.session.subscribe_all(channels.ROUTER_STATUS, waking=False)
        self._recorders = self.session.subscribe_all(channels.RECORDER, waking=False)
        self.tracker = self.session.subscribe(channels.TRACKER_STATUS, channels.TRACKER_UNIT)
        self._latency: LatencyWatch | None = None
        self._watching = threading.Lock()
        self._motion: ObservedMotion | None = None
        self._left_behind: frozenset[str] = frozenset()  # by a take-off, on the floor

    def _join(self, clock: Callable[[], float] | None, timeout_s: float) -> None:
        address = bus_address(self.file, self._host, self._process)
        self._notifier = Notifier(clock or address.clock.now)
        self.session = Session(address, self._notifier, clock=clock, timeout_s=timeout_s, begin=False)
        begin_turns(self.session)

    def __str__(self) -> str:
        """The fleet, and a line about each of its vehicles."""
        states = [f"  {self.state_of(name)}" for name in self.file.vehicles]
        return "\n".join([f"fleet {self.file.name}", *states])

    def __repr__(self) -> str:
        """Name of the fleet and of its vehicles."""
        return f"<{type(self).__name__} {self.file.name}: {', '.join(self.file.vehicles)}>"

    def wait(self, seconds: float) -> None:
        """Wait in the time of the fleet, which passes at another speed than real time in slow motion."""
        self._notifier.wait_until(lambda: False, seconds)

    def _starting_s(self, real_s: float) -> float:
        """Return how long processes may take that need real time, however fast that of the fleet passes."""
        return max(1.0, self.file.clock.speed) * real_s

    def close(self) -> None:
        """Leave the bus; the fleet flies on."""
        self.session.close()

    def _named(self, names: Iterable[str]) -> list[str]:
        """Return the named vehicles, or the one that a text names; KeyError if there is none of a name."""
        vehicles = [names] if isinstance(names, str) else list(names)
        for name in vehicles:
            if name not in self.file.vehicles:
                raise KeyError(f"no vehicle {name!r}, known are {', '.join(self.file.vehicles)}")
        return vehicles

    def state_of(self, name: str) -> VehicleState:
        """Present state of a vehicle."""
        now_s = self.session.clock()
        agent, agent_age_s = _newest(self._agents.inboxes.get(name), now_s)
        transmitter, transmitter_age_s = _newest(self._transmitters.inboxes.get(name), now_s)
        pose_age_s = None
        if agent is not None and agent_age_s is not None and agent.pose_age_s is not None:
            pose_age_s = agent.pose_age_s + agent_age_s
        unseen_s = self._unseen_s(name, now_s)
        motion = self._motion
        pose = None if motion is None else _newest(motion.poses.inboxes.get(name), now_s)[0]
        plan = None if motion is None else _newest(motion.plans.inboxes.get(name), now_s)[0]
        return VehicleState(
            name,
            agent,
            transmitter,
            agent_age_s,
            transmitter_age_s,
            pose_age_s,
            seen_age_s=pose_age_s if unseen_s is None else unseen_s,
            plan=plan,
            seen_at_m=None if pose is None else pose.position_m,
            quaternion_xyzw=None if pose is None else pose.quaternion_xyzw,
            latency_ms={} if self._latency is None else self._latency.figures(name),
        )

    def watch_latency(self) -> None:
        """Subscribe to every command that is written, so that states include latencies by stage."""
        if self._latency is None:
            from rcopterx.ground_station.report.latency import LatencyWatch, clock_offset

            self._latency = LatencyWatch(
                self.session, lambda first, second: clock_offset(self._router_statuses(), first, second)
            )

    def watch_motion(self) -> ObservedMotion:
        """Subscribe to every pose and plan, so that states include them: for pages that draw.

        They are a hundred messages a second of each vehicle, from every host to this one.
        """
        with self._watching:
            if self._motion is None:
                poses = self.session.subscribe_all(channels.POSE)
                plans = self.session.subscribe_all(channels.PLAN)
                self._motion = ObservedMotion(poses, plans, self.session.clock())
            return self._motion

    def _moving_state_of(self, name: str, complete: Callable[[VehicleState], bool]) -> VehicleState:
        """State of a vehicle with its motion; waits until it is complete if the subscription is new."""
        left_s = self.watch_motion().since_s + FIRST_MOTION_S - self.session.clock()
        if left_s > 0:
            self._notifier.wait_until(lambda: complete(self.state_of(name)), left_s)
        return self.state_of(name)

    def plan_of(self, name: str) -> Plan | None:
        """Newest plan of a vehicle, None before the first; the first call subscribes to plans."""
        return self._moving_state_of(name, lambda state: state.plan is not None).plan

    def present(self) -> list[str]:
        """Vehicles of the fleet file that take part: all but those that are absent and run nowhere else."""
        launchers = self.launchers().values()
        absent = {name for status in launchers for name in status.absent}
        absent -= {name for status in launchers for name in status.running}
        return [name for name in self.file.vehicles if name not in absent]

    def launchers(self) -> dict[str, LauncherStatus]:
        """Statuses of the launchers by host, without silent ones."""
        return _alive(self._launchers.inboxes, self.session.clock())

    def recorders(self) -> dict[str, RecorderStatus]:
        """Statuses of the flight logs by host, without silent ones."""
        return _alive(self._recorders.inboxes, self.session.clock())

    def last_launchers(self) -> dict[str, LauncherStatus]:
        """Last statuses of the launchers by host, also of silent ones."""
        found = {host: _newest(inbox, 0.0)[0] for host, inbox in tuple(self._launchers.inboxes.items())}
        return {host: status for host, status in found.items() if status is not None}

    def _router_statuses(self) -> dict[str, RouterStatus]:
        return _alive(self._routers.inboxes, self.session.clock())

    def _unseen_s(self, name: str, now_s: float) -> float | None:
        """How long the motion capture has not seen a vehicle; None if the Vicon gateway does not say."""
        status, age_s = _newest(self.tracker, now_s)
        for subject in () if status is None else status.subjects:
            if subject.vehicle == name and subject.occluded_s is not None and age_s is not None:
                return subject.occluded_s + age_s
        return None

    def problems(self, names: Iterable[str] | None = None) -> list[str]:
        """Problems that block take-off, one line each."""
        vehicles = self.present() if names is None else self._named(names)
        tracker, age_s = _newest(self.tracker, self.session.clock())
        found = tracker_problems(tracker, age_s, vehicles)
        found += [line for name in vehicles for line in self.state_of(name).problems()]
        return list(dict.fromkeys(found))  # one vehicle may be a problem of several

    def notes(self) -> list[str]:
        """Notes that do not block take-off: subjects, recordings, hosts, failures in flight."""
        now_s, statuses = self.session.clock(), self.statuses()
        tracker = _newest(self.tracker, now_s)[0]
        lines = [*tracker_notes(tracker), *link_notes(self._router_statuses(), self._host)]
        for host, inbox in tuple(self._recorders.inboxes.items()):
            if (received := inbox.latest()) is not None:
                lines += recorder_notes(host, received.message, inbox.alive(now_s))
        for host, launcher in self.launchers().items():
            lines += launcher_notes(host, launcher)
        for name, status in statuses.items():
            if (factor := status.diagnostics.effort_factor) > 1.0:
                lines.append(f"{name} oscillated: effort factor {factor:g} until it is tuned")
            lines += [f"{name}: {remark}" for remark in status.diagnostics.remarks]
            if learned := self.state_of(name).learned:
                lines.append(f"{name} {learned}")
        return lines

    def crowded_hosts(self) -> list[str]:
        """A line for every host on which more agents run than it serves without missed control periods."""
        return [line for host, status in self.launchers().items() for line in capacity_notes(host, status)]

    def clock_differences(self, limit_s: float) -> list[str]:
        """A line for every host whose clock differs from that of the host used here by more than a limit."""
        return clock_differences(self._router_statuses(), self._host, limit_s)

    def followers(self, name: str) -> list[str]:
        """Vehicles that follow a vehicle now, by plans that are newer than this call."""
        from_s = self.session.clock() + UNDER_WAY_S
        inboxes = self.watch_motion().plans.inboxes

        def new_plans() -> dict[str, Plan]:
            return {
                other: received.message
                for other, inbox in tuple(inboxes.items())
                if (received := inbox.latest()) is not None and received.arrived_s >= from_s
            }

        self._notifier.wait_until(lambda: set(self.statuses()) <= new_plans().keys(), FIRST_STATUS_S)
        return [
            other for other, plan in new_plans().items() if name in [link.leader for link in plan.following]
        ]

    def statuses(self) -> dict[str, AgentStatus]:
        """Newest statuses of the agents by vehicle, without silent ones."""
        known = _alive(self._agents.inboxes, self.session.clock())
        return {name: known[name] for name in self.file.vehicles if name in known}

    def frame_period_s(self, name: str) -> float:
        """Time between the frames of the motion capture [s]."""
        status = _newest(self.tracker, self.session.clock())[0]
        reported_s = 0.0 if status is None else status.period_s
        return reported_s or self.file.vehicles[name].control.period_s

    def wait_for_status(self, names: Iterable[str] | None = None, timeout_s: float = FIRST_STATUS_S) -> bool:
        """Wait for a first status of vehicles after joining; False if one is missing.

        Without names it waits for all vehicles and the Vicon gateway.
        """
        wanted = None if names is None else self._named(names)

        def complete() -> bool:
            states = [self.state_of(name) for name in (self.present() if wanted is None else wanted)]
            reported = all(state.agent is not None and state.transmitter is not None for state in states)
            return reported and (wanted is not None or self.tracker.latest() is not None)

        return self._notifier.wait_until(complete, timeout_s)

    def wait_until(
        self, condition: Callable[[], bool], timeout_s: float, what: str, names: Iterable[str] = ()
    ) -> None:
        """Wait until a condition on the fleet's state holds.

        Raises `NotReachedError` after `timeout_s`, which names `what` and the state of the vehicles `names`.
        """
        vehicles = self._named(names)
        if not self._notifier.wait_until(condition, timeout_s):
            states = "; ".join(self.state_of(name).summary() for name in vehicles)
            raise NotReachedError(f"after {timeout_s:g} s: {what}" + (f" ({states})" if states else ""))

    def _wait_for_none(self, missing: Callable[[], list[str]], timeout_s: float, what: str) -> None:
        """Wait until a list is empty; the error has the lines that are left."""
        if not self._notifier.wait_until(lambda: not missing(), timeout_s):
            raise NotReachedError(f"after {timeout_s:g} s: {what}: {'; '.join(missing())}")

    def wait_ready(self, names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        """Wait until nothing blocks take-off, for processes that start never less than in real time."""
        vehicles = None if names is None else self._named(names)
        self._wait_for_none(lambda: self.problems(vehicles), self._starting_s(timeout_s), "not ready")

    def wait_for_phase(self, phase: str, names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        """Wait until vehicles, by default all, are in a flight phase.

        Raises
        ------
        NotReachedError
            They were not within `timeout_s`; names those that are not and the state of each.
        ValueError
            There is no such phase.
        """
        wanted = Phase(phase)
        vehicles = None if names is None else self._named(names)

        def missing() -> list[str]:
            states = [self.state_of(name) for name in (self.present() if vehicles is None else vehicles)]
            return [state.summary() for state in states if state.phase != wanted]

        self._wait_for_none(missing, timeout_s, f"not {phase}")

    def wait_for_formation(
        self, names: Iterable[str] | None = None, tolerance_m: float = 0.1, timeout_s: float = 20.0
    ) -> None:
        """Wait until followers, by default all, are at their places and their offsets at rest.

        Raises `NotReachedError` after `timeout_s`, which says what is missing of each.
        """
        self._wait_for_places(
            names, lambda state: formation_problem(state, tolerance_m), timeout_s, followers=True
        )

    def wait_for_arrival(
        self, names: Iterable[str] | None = None, tolerance_m: float = 0.1, timeout_s: float = 15.0
    ) -> None:
        """Wait until vehicles, by default all that do not follow, are at their set points.

        Raises `NotReachedError` after `timeout_s`, which says how far each one is away.
        """
        self._wait_for_places(
            names, lambda state: arrival_problem(state, tolerance_m), timeout_s, followers=False
        )

    def _wait_for_places(
        self,
        names: Iterable[str] | None,
        problem: Callable[[VehicleState], str],
        timeout_s: float,
        followers: bool,
    ) -> None:
        """Wait until new states show no problem of any vehicle, or of all followers, or of all others."""
        what = "no formation" if followers else "not there"
        wanted = self.present() if names is None else self._named(names)
        from_s = self.session.clock() + UNDER_WAY_S

        def problem_of(name: str) -> str:
            state = self.state_of(name)
            if names is None and name in self._left_behind and not state.airborne:
                return ""
            if not arrived_after(from_s, state.agent_age_s, self.session.clock()):
                return f"{name}: agent not responding"
            return "" if names is None and bool(state.assigned) != followers else problem(state)

        self._wait_for_none(lambda: [line for name in wanted if (line := problem_of(name))], timeout_s, what)


def _newest(inbox: Inbox[M] | None, now_s: float) -> tuple[M | None, float | None]:
    """Newest message of an inbox and its age [s]."""
    received = None if inbox is None else inbox.latest()
    return (None, None) if received is None else (received.message, max(0.0, now_s - received.arrived_s))


def _alive(inboxes: Mapping[str, Inbox[M]], now_s: float) -> dict[str, M]:
    return {
        unit: received.message
        for unit, inbox in tuple(inboxes.items())
        if inbox.alive(now_s) and (received := inbox.latest()) is not None
    }
