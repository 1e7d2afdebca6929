"""The state of a fleet, read from its messages: those of a bus, or those of a recorded flight."""

import threading
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from rcopterx.bus import channels
from rcopterx.bus.host_messages import LauncherStatus, RouterStatus
from rcopterx.bus.log_messages import RecorderStatus
from rcopterx.bus.message import Message
from rcopterx.bus.messages import AgentStatus, Plan, Pose, ZoneSet
from rcopterx.bus.subscription import Inbox, Source, Units
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.scripting.notes import (
    capacity_notes,
    clock_differences,
    launcher_notes,
    link_notes,
    recorder_notes,
    tracker_notes,
    tracker_problems,
)
from rcopterx.ground_station.scripting.state import VehicleState

if TYPE_CHECKING:
    from rcopterx.ground_station.report.latency import LatencyWatch  # few programs watch it

M = TypeVar("M", bound=Message)


class ObservedMotion(NamedTuple):
    """Subscriptions to poses and plans of all vehicles, and when they began [s]."""

    poses: Units[Pose]
    plans: Units[Plan]
    since_s: float


class Reader:
    """Reads the messages of a fleet; poses and plans only after `watch_motion`.

    `host` is the host from whose router, or in whose flight log, they are.
    """

    def __init__(self, file: FleetFile, host: str, source: Source) -> None:
        self.file, self._host, self.source = file, host, source
        self._agents = source.subscribe_all(channels.AGENT_STATUS)
        self._transmitters = source.subscribe_all(channels.TRANSMITTER_STATUS)
        self._launchers = source.subscribe_all(channels.LAUNCHER)
        self._routers = source.subscribe_all(channels.ROUTER_STATUS, waking=False)
        self._recorders = source.subscribe_all(channels.RECORDER, waking=False)
        self.tracker = source.subscribe(channels.TRACKER_STATUS, channels.TRACKER_UNIT)
        self._latency: LatencyWatch | None = None
        self._watching = threading.Lock()
        self._motion: ObservedMotion | None = None

    def __str__(self) -> str:
        """The fleet, and a line about each of its vehicles."""
        states = [f"  {self.state_of(name)}" for name in self.file.vehicles]
        return "\n".join([f"fleet {self.file.name}", *states])

    def __repr__(self) -> str:
        """Name of the fleet and of its vehicles."""
        return f"<{type(self).__name__} {self.file.name}: {', '.join(self.file.vehicles)}>"

    def _named(self, names: Iterable[str]) -> list[str]:
        """Return the named vehicles, or the one that a text names; KeyError if there is none of a name."""
        vehicles = [names] if isinstance(names, str) else list(names)
        for name in vehicles:
            if name not in self.file.vehicles:
                raise KeyError(f"no vehicle {name!r}, known are {', '.join(self.file.vehicles)}")
        return vehicles

    def state_of(self, name: str) -> VehicleState:
        """Present state of a vehicle."""
        now_s = self.source.clock()
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
                self.source, lambda first, second: clock_offset(self._router_statuses(), first, second)
            )

    def watch_motion(self) -> ObservedMotion:
        """Subscribe to every pose and plan, so that states include them: for pages that draw.

        They are a hundred messages a second of each vehicle, from every host to this one.
        """
        with self._watching:
            if self._motion is None:
                poses = self.source.subscribe_all(channels.POSE)
                plans = self.source.subscribe_all(channels.PLAN)
                self._motion = ObservedMotion(poses, plans, self.source.clock())
            return self._motion

    def present(self) -> list[str]:
        """Vehicles of the fleet file that take part: all but those that are absent and run nowhere else."""
        launchers = self.launchers().values()
        absent = {name for status in launchers for name in status.absent}
        absent -= {name for status in launchers for name in status.running}
        return [name for name in self.file.vehicles if name not in absent]

    def launchers(self) -> dict[str, LauncherStatus]:
        """Statuses of the launchers by host, without silent ones."""
        return _alive(self._launchers.inboxes, self.source.clock())

    def recorders(self) -> dict[str, RecorderStatus]:
        """Statuses of the flight logs by host, without silent ones."""
        return _alive(self._recorders.inboxes, self.source.clock())

    def last_launchers(self) -> dict[str, LauncherStatus]:
        """Last statuses of the launchers by host, also of silent ones."""
        found = {host: _newest(inbox, 0.0)[0] for host, inbox in tuple(self._launchers.inboxes.items())}
        return {host: status for host, status in found.items() if status is not None}

    def _router_statuses(self) -> dict[str, RouterStatus]:
        return _alive(self._routers.inboxes, self.source.clock())

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
        tracker, age_s = _newest(self.tracker, self.source.clock())
        found = tracker_problems(tracker, age_s, vehicles)
        found += [line for name in vehicles for line in self.state_of(name).problems()]
        return list(dict.fromkeys(found))  # one vehicle may be a problem of several

    def notes(self) -> list[str]:
        """Notes that do not block take-off: subjects, recordings, hosts, failures in flight."""
        now_s, statuses = self.source.clock(), self.statuses()
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

    def statuses(self, *subjects: str) -> dict[str, AgentStatus]:
        """Newest statuses of the agents by vehicle, without silent ones, and those of these subjects."""
        known = _alive(self._agents.inboxes, self.source.clock())
        return {name: known[name] for name in (*self.file.vehicles, *subjects) if name in known}

    @property
    def zones(self) -> ZoneSet:
        """Keep-out zones: those of the fleet file, or the latest of any agent once they were changed."""
        changed = [status.zones for status in self.statuses().values() if status.zones is not None]
        of_file = ZoneSet(revision=0, zones=self.file.zones)
        return max(changed, key=lambda zones: zones.revision, default=of_file)

    def frame_period_s(self, name: str) -> float:
        """Time between the frames of the motion capture [s]."""
        status = _newest(self.tracker, self.source.clock())[0]
        reported_s = 0.0 if status is None else status.period_s
        return reported_s or self.file.vehicles[name].control.period_s


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
