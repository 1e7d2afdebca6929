"""What is known of a running fleet, and waiting for it; whoever only watches needs nothing else."""

import threading
from collections.abc import Callable, Iterable
from typing import NamedTuple, TypeVar

from rcopterx.agents.following.peers import PeerStatuses
from rcopterx.agents.phases import Phase
from rcopterx.bus import channels
from rcopterx.bus.link_messages import RouterStatus
from rcopterx.bus.message import Message
from rcopterx.bus.messages import AgentStatus, LauncherStatus, Plan, Pose
from rcopterx.bus.rounding import monotonic_s
from rcopterx.bus.session import Session
from rcopterx.bus.subscription import Inbox, UnitSubscriptions
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.report.latency import LatencyWatch, clock_offset
from rcopterx.ground_station.scripting.hosts import clock_differences, host_notes
from rcopterx.ground_station.scripting.in_place import away, out_of_place
from rcopterx.ground_station.scripting.joining import WrongFleetError, check_identity
from rcopterx.ground_station.scripting.state import (
    VehicleState,
    crowded,
    launcher_notes,
    tracker_notes,
    tracker_problems,
)
from rcopterx.ground_station.scripting.waiting import Notifier, NotReachedError

M = TypeVar("M", bound=Message)

FIRST_STATUS_S = 1.5
"""Longest wait for a first status, which comes five times a second."""
UNDER_WAY_S = 0.05
"""A status that arrives so soon after a question may have been sent before it."""
FIRST_MOTION_S = 0.5
"""Longest wait for a first plan or pose, which come every control period."""


class Motion(NamedTuple):
    """Poses and plans of all vehicles, and since when they are heard [s]."""

    poses: UnitSubscriptions[Pose]
    plans: UnitSubscriptions[Plan]
    since_s: float


class Observer:
    """Hears what a fleet says of itself; every pose and plan only if that is asked for.

    Parameters
    ----------
    file
        The fleet file, loaded.
    host
        Host whose router is used; by default the first one of the file.
    timeout_s
        How long to look for the router.
    clock
        Monotonic clock [s], for ages and waits.

    Raises
    ------
    BusUnreachableError
        No router answers: the fleet is not up.
    WrongFleetError
        The router belongs to another fleet, or to one that was started from another version of the file.
    """

    def __init__(
        self,
        file: FleetFile,
        host: str | None = None,
        timeout_s: float = 3.0,
        clock: Callable[[], float] = monotonic_s,
    ) -> None:
        self.file = file
        self._notifier = Notifier(clock)
        self._host = host or next(iter(file.hosts))
        address = bus_address(file, self._host)
        self.session = Session(address, wake=self._notifier.notify, clock=clock, timeout_s=timeout_s)
        try:
            check_identity(self.session, file)
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
        self._motion: Motion | None = None

    def __str__(self) -> str:
        """The fleet, and a line about each of its vehicles."""
        return "\n".join(
            [f"fleet {self.file.name}", *(f"  {self.state_of(name)}" for name in self.file.vehicles)]
        )

    def __repr__(self) -> str:
        """Name of the fleet and of its vehicles."""
        return f"<{type(self).__name__} {self.file.name}: {', '.join(self.file.vehicles)}>"

    def close(self) -> None:
        """Leave the bus; the fleet goes on flying."""
        self.session.close()

    def state_of(self, name: str) -> VehicleState:
        """Present state of a vehicle."""
        now_s = self.session.clock()
        agent, agent_age_s = _newest(self._agents.inboxes.get(name), now_s)
        transmitter, transmitter_age_s = _newest(self._transmitters.inboxes.get(name), now_s)
        pose_age_s = None
        if agent is not None and agent_age_s is not None and agent.diagnostics.pose_age_s is not None:
            pose_age_s = agent.diagnostics.pose_age_s + agent_age_s
        unseen_s = self._unseen_s(name, now_s)
        seen_age_s = pose_age_s if unseen_s is None else unseen_s
        motion = self._motion
        pose = None if motion is None else _newest(motion.poses.inboxes.get(name), now_s)[0]
        plan = None if motion is None else _newest(motion.plans.inboxes.get(name), now_s)[0]
        return VehicleState(
            name, agent, transmitter, agent_age_s, transmitter_age_s, pose_age_s, seen_age_s, plan,
            None if pose is None else pose.position_m, None if pose is None else pose.quaternion_xyzw,
            {} if self._latency is None else self._latency.figures(name),
        )  # fmt: skip

    def watch_latency(self) -> None:
        """From now on states tell latencies by stage; every command that is written is heard for that."""
        if self._latency is None:

            def offset(first: str, second: str) -> float | None:
                return clock_offset(self._routers_heard(), first, second)

            self._latency = LatencyWatch(self.session, offset)

    def watch_motion(self) -> None:
        """From now on every pose and every plan is heard, and states tell them: for pages that draw.

        They are a hundred messages a second of each vehicle, from every host to this one.
        """
        self._heard_motion()

    def _heard_motion(self) -> Motion:
        with self._watching:
            if self._motion is None:
                poses = self.session.subscribe_all(channels.POSE)
                plans = self.session.subscribe_all(channels.PLAN)
                self._motion = Motion(poses, plans, self.session.clock())
            return self._motion

    def _moving_state_of(self, name: str, heard: Callable[[VehicleState], bool]) -> VehicleState:
        """State of a vehicle with its motion; waits for what `heard` asks for if that is new."""
        left_s = self._heard_motion().since_s + FIRST_MOTION_S - self.session.clock()
        if left_s > 0:
            self._notifier.wait_until(lambda: heard(self.state_of(name)), left_s)
        return self.state_of(name)

    def plan_of(self, name: str) -> Plan | None:
        """Newest plan of a vehicle, None before the first; from the first question on plans are heard."""
        return self._moving_state_of(name, lambda state: state.plan is not None).plan

    def present(self) -> list[str]:
        """Vehicles of the fleet file that take part: all but those that are absent and run nowhere else."""
        launchers = self.launchers().values()
        absent = {name for status in launchers for name in status.absent}
        absent -= {name for status in launchers for name in status.running}
        return [name for name in self.file.vehicles if name not in absent]

    def launchers(self) -> dict[str, LauncherStatus]:
        """What the launchers of all hosts say of their processes, by host; silent ones are left out."""
        now_s = self.session.clock()
        return {
            host: received.message
            for host, inbox in tuple(self._launchers.inboxes.items())
            if inbox.alive(now_s) and (received := inbox.latest()) is not None
        }

    def _unseen_s(self, name: str, now_s: float) -> float | None:
        """How long the motion capture has not seen a vehicle, as far as the Vicon gateway tells."""
        status, age_s = _newest(self.tracker, now_s)
        for subject in () if status is None else status.subjects:
            if subject.vehicle == name and subject.occluded_s is not None and age_s is not None:
                return subject.occluded_s + age_s
        return None

    def problems(self, names: Iterable[str] | None = None) -> list[str]:
        """What blocks take-off, one line each; empty when nothing does."""
        vehicles = self.present() if names is None else list(names)
        tracker, age_s = _newest(self.tracker, self.session.clock())
        found = tracker_problems(tracker, age_s, vehicles)
        return found + [line for name in vehicles for line in self.state_of(name).problems()]

    def notes(self) -> list[str]:
        """Remarks that do not block take-off: subjects, recordings, hosts, what failed in flight."""
        lowered = [
            f"{name} oscillated: effort factor {status.diagnostics.effort_factor:g} until it is tuned"
            for name, status in self.statuses().items()
            if status.diagnostics.effort_factor > 1.0
        ]
        told = [
            f"{name}: {remark}"
            for name, status in self.statuses().items()
            for remark in status.diagnostics.remarks
        ]
        launchers = [
            line for host, status in self.launchers().items() for line in launcher_notes(host, status)
        ]
        tracker = _newest(self.tracker, self.session.clock())[0]
        return tracker_notes(tracker) + self._host_notes() + self._log_notes() + launchers + lowered + told

    def crowded_hosts(self) -> list[str]:
        """A line for every host on which more agents run than it serves without missed control periods."""
        return [line for host, status in self.launchers().items() for line in crowded(host, status)]

    def clock_differences(self, limit_s: float) -> list[str]:
        """A line for every host whose clock differs from that of the host used here by more than a limit."""
        return clock_differences(self._routers_heard(), self._host, limit_s)

    def _host_notes(self) -> list[str]:
        """Links and clocks of hosts."""
        return host_notes(self._routers_heard(), self._host)

    def _routers_heard(self) -> dict[str, RouterStatus]:
        """What routers say of their links, by host; silent ones are left out."""
        now_s = self.session.clock()
        return {
            host: received.message
            for host, inbox in tuple(self._routers.inboxes.items())
            if inbox.alive(now_s) and (received := inbox.latest()) is not None
        }

    def _log_notes(self) -> list[str]:
        """What is wrong with the flight log."""
        now_s, found = self.session.clock(), []
        for host, inbox in tuple(self._recorders.inboxes.items()):
            status, _ = _newest(inbox, now_s)
            if status is None:
                continue
            if not inbox.alive(now_s):
                found.append(f"flight log: the recorder on {host} is not responding")
            elif status.state == "stopped":
                found.append(f"flight log: recording stopped: {status.reason}")
            if status.lost:
                found.append(f"flight log: {status.lost} messages lost")
        return found

    def followers(self, name: str) -> list[str]:
        """Vehicles that follow a vehicle now, by plans that are newer than this call."""
        from_s = self.session.clock() + UNDER_WAY_S
        plans = self._heard_motion().plans

        def heard() -> dict[str, Plan]:
            found = {}
            for other, inbox in tuple(plans.inboxes.items()):
                received = inbox.latest()
                if received is not None and received.arrived_s >= from_s:
                    found[other] = received.message
            return found

        self._notifier.wait_until(lambda: set(self.statuses()) <= heard().keys(), FIRST_STATUS_S)
        return [other for other, plan in heard().items() if name in [link.leader for link in plan.following]]

    def statuses(self) -> dict[str, AgentStatus]:
        """Newest statuses of the agents that are not silent."""
        known = PeerStatuses("", self._agents.inboxes, self.session.clock).statuses()
        return {name: known[name] for name in self.file.vehicles if name in known}

    def frame_period_s(self, name: str) -> float:
        """Time between the frames of the motion capture [s]."""
        status = _newest(self.tracker, self.session.clock())[0]
        told_s = 0.0 if status is None else status.period_s
        return told_s or self.file.vehicles[name].control.period_s

    def wait_for_status(self, names: Iterable[str] | None = None, timeout_s: float = FIRST_STATUS_S) -> bool:
        """Wait for a first status of everybody after joining; False if one is missing.

        Without names all vehicles and the Vicon gateway are waited for.
        """
        wanted = None if names is None else list(names)
        everybody = names is None

        def heard() -> bool:
            states = [self.state_of(name) for name in (self.present() if wanted is None else wanted)]
            reported = all(state.agent is not None and state.transmitter is not None for state in states)
            return reported and (not everybody or self.tracker.latest() is not None)

        return self._notifier.wait_until(heard, timeout_s)

    def wait_until(
        self, condition: Callable[[], bool], timeout_s: float, what: str, names: Iterable[str] = ()
    ) -> None:
        """Wait until a condition on the fleet's state holds.

        Raises
        ------
        NotReachedError
            It did not within `timeout_s`; the text names `what` and the state of the vehicles `names`.
        """
        if not self._notifier.wait_until(condition, timeout_s):
            states = "; ".join(self.state_of(name).summary() for name in names)
            raise NotReachedError(f"after {timeout_s:g} s: {what}" + (f" ({states})" if states else ""))

    def wait_ready(self, names: Iterable[str] | None = None, timeout_s: float = 15.0) -> None:
        """Wait until nothing blocks take-off."""
        vehicles = None if names is None else list(names)
        if not self._notifier.wait_until(lambda: not self.problems(vehicles), timeout_s):
            found = "; ".join(self.problems(vehicles))
            raise NotReachedError(f"not ready after {timeout_s:g} s: {found}")

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
        vehicles = None if names is None else list(names)

        def others() -> list[str]:
            named = self.present() if vehicles is None else vehicles
            return [name for name in named if self.state_of(name).phase != wanted]

        if not self._notifier.wait_until(lambda: not others(), timeout_s):
            states = "; ".join(self.state_of(name).summary() for name in others())
            raise NotReachedError(f"after {timeout_s:g} s: not {phase}: {states}")

    def wait_for_formation(
        self, names: Iterable[str] | None = None, tolerance_m: float = 0.1, timeout_s: float = 20.0
    ) -> None:
        """Wait until followers, by default all, are at their places and their offsets at rest.

        Raises
        ------
        NotReachedError
            They were not within `timeout_s`; says what is missing of each.
        """
        wanted = self.present() if names is None else list(names)
        from_s = self.session.clock() + UNDER_WAY_S

        def missing() -> list[str]:
            states = [self._told_after(name, from_s) for name in wanted]
            if names is None:
                states = [state for state in states if isinstance(state, str) or state.assigned]
            found = [
                state if isinstance(state, str) else out_of_place(state, tolerance_m) for state in states
            ]
            return [line for line in found if line]

        if not self._notifier.wait_until(lambda: not missing(), timeout_s):
            raise NotReachedError(f"after {timeout_s:g} s: no formation: {'; '.join(missing())}")

    def wait_for_arrival(
        self, names: Iterable[str] | None = None, tolerance_m: float = 0.1, timeout_s: float = 15.0
    ) -> None:
        """Wait until vehicles, by default all that follow nobody, are at their set points.

        Raises
        ------
        NotReachedError
            They were not within `timeout_s`; says how far each one is away.
        """
        wanted = self.present() if names is None else list(names)
        from_s = self.session.clock() + UNDER_WAY_S

        def missing() -> list[str]:
            states = [self._told_after(name, from_s) for name in wanted]
            if names is None:
                states = [state for state in states if isinstance(state, str) or not state.assigned]
            found = [state if isinstance(state, str) else away(state, tolerance_m) for state in states]
            return [line for line in found if line]

        if not self._notifier.wait_until(lambda: not missing(), timeout_s):
            raise NotReachedError(f"after {timeout_s:g} s: not there: {'; '.join(missing())}")

    def _told_after(self, name: str, from_s: float) -> VehicleState | str:
        """State of a vehicle from what its agent said after a time, or what is missing."""
        state = self.state_of(name)
        if state.agent_age_s is None or self.session.clock() - state.agent_age_s < from_s:
            return f"{name}: agent not responding"
        return state


def _newest(inbox: Inbox[M] | None, now_s: float) -> tuple[M | None, float | None]:
    if inbox is None:
        return None, None
    received = inbox.latest()
    return (None, None) if received is None else (received.message, max(0.0, now_s - received.arrived_s))
