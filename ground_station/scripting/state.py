"""What is known of a vehicle and of the motion capture at one moment, and what blocks take-off."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from rcopterx.agents.phases import AIRBORNE
from rcopterx.bus.messages import (
    AgentStatus,
    LauncherStatus,
    LeaderLink,
    Plan,
    TrackerStatus,
    TransmitterStatus,
)
from rcopterx.ground_station.report.latency import Percentiles

STALE_S = 1.0
"""Age from which a status counts as silence; it comes five times a second."""
ALARMING_STATES: Final = frozenset({"hold", "descend", "land", "cut", "killed"})
"""States of the arbiter that are not the agent's will."""


@dataclass(frozen=True, repr=False)
class VehicleState:
    """What is known of a vehicle at this moment; ages are on the local monotonic clock.

    It prints as one line; the attributes have everything.

    Attributes
    ----------
    agent, transmitter
        Newest status of each, None before the first.
    agent_age_s, transmitter_age_s
        Their ages.
    pose_age_s
        Age of the newest message of the motion capture about the vehicle that its agent has received, whether
        it was seen or not.
    seen_age_s
        Time since the motion capture last saw the vehicle; None if nobody knows.
    plan
        Newest plan; None before the first, and unless motion is watched (`Observer.watch_motion`).
    seen_at_m
        Where the motion capture sees the vehicle; None if it does not, and unless motion is watched.
    quaternion_xyzw
        Attitude that the motion capture sees; None if it does not, and unless motion is watched.
    latency_ms
        Percentiles of the time that the newest commands spent in each stage on their way, see
        `rcopterx.ground_station.report.latency`; empty unless they are watched.
    """

    name: str
    agent: AgentStatus | None
    transmitter: TransmitterStatus | None
    agent_age_s: float | None
    transmitter_age_s: float | None
    pose_age_s: float | None
    seen_age_s: float | None = None
    plan: Plan | None = None
    seen_at_m: tuple[float, float, float] | None = None
    quaternion_xyzw: tuple[float, float, float, float] | None = None
    latency_ms: Mapping[str, Percentiles] = field(default_factory=dict)

    @property
    def phase(self) -> str:
        """Flight phase, `unknown` without a status."""
        return "unknown" if self.agent is None else self.agent.phase

    @property
    def flown_by(self) -> str:
        """The external program that flies it, else the name of its controller; empty without a status."""
        if self.agent is None:
            return ""
        client = self.agent.diagnostics.client
        return f"{client} (external)" if client else self.agent.diagnostics.controller

    @property
    def host(self) -> str | None:
        """Host its agent runs on, as far as it tells."""
        return None if self.agent is None else self.agent.diagnostics.host

    @property
    def transmitter_state(self) -> str:
        """State of the arbiter, `unknown` without a status."""
        return "unknown" if self.transmitter is None else self.transmitter.state

    @property
    def airborne(self) -> bool:
        """Whether the vehicle is in the air as far as its agent tells."""
        return self.phase in AIRBORNE

    @property
    def position_m(self) -> tuple[float, float, float] | None:
        """Where the vehicle is, as its agent says; None while it does not know."""
        return None if self.agent is None else self.agent.position_m

    @property
    def alarming(self) -> bool:
        """Whether the arbiter flies the vehicle, or has cut its motors, instead of its agent."""
        return self.transmitter_state in ALARMING_STATES

    @property
    def leaders(self) -> tuple[str, ...]:
        """Vehicles it follows."""
        return () if self.agent is None else tuple(link.leader for link in self.agent.following)

    @property
    def assigned(self) -> tuple[LeaderLink, ...]:
        """Leaders with the offsets it was told, wherever an offset is on its way now."""
        return () if self.agent is None else self.agent.assigned

    @property
    def error_m(self) -> float | None:
        """Distance from the reference, as the agent sees it; None on the floor."""
        if self.plan is not None:
            return error_of(self.plan)
        return None if self.agent is None else self.agent.error_m

    def __str__(self) -> str:
        words = [self.phase, f"transmitter {self.transmitter_state}"]
        if self.agent is not None:
            words.append(f"flown by {self.flown_by}")
            words.append(f"follows {', '.join(self.leaders)}" if self.leaders else "leads")
            if self.position_m is not None:
                x, y, z = self.position_m
                words.append(f"at {x:.2f} {y:.2f} {z:.2f} m")
            if self.agent.yaw_rad is not None:
                words.append(f"heading {math.degrees(self.agent.yaw_rad):.0f} deg")
        if self.error_m is not None:
            words.append(f"error {1000 * self.error_m:.0f} mm")
        return f"{self.name}: {', '.join(words)}"

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self}>"

    def summary(self) -> str:
        """Phase and transmitter state in words."""
        if self.transmitter is None:
            return f"{self.name}: {self.phase}"
        return f"{self.name}: {self.phase}, transmitter {self.transmitter.state}: {self.transmitter.reason}"

    def problems(self, stale_s: float = STALE_S) -> list[str]:
        """What blocks take-off, one line each; empty when nothing does."""
        found = []
        if self.agent is None or self.agent_age_s is None or self.agent_age_s > stale_s:
            found.append(f"{self.name}: agent not responding{_since(self.agent_age_s)}")
        elif self.agent.diagnostics.pose_age_s is None or self.agent.diagnostics.pose_age_s > stale_s:
            found.append(f"{self.name}: no pose{_since(self.agent.diagnostics.pose_age_s)}")
        elif self.seen_age_s is None or self.seen_age_s > stale_s:
            found.append(f"{self.name}: the motion capture does not see it{_since(self.seen_age_s)}")
        if self.transmitter is None or self.transmitter_age_s is None or self.transmitter_age_s > stale_s:
            found.append(f"{self.name}: transmitter gateway not responding{_since(self.transmitter_age_s)}")
        elif not self.transmitter.ready:
            found.append(f"{self.name}: transmitter not ready: {self.transmitter.module}")
        elif self.transmitter.state == "killed":
            found.append(f"{self.name}: killed ({self.transmitter.reason}); reset it first")
        return found


def error_of(plan: Plan) -> float | None:
    """Distance of the beginning of a plan from its reference [m]; None on the floor."""
    if plan.reference is None or not plan.airborne:
        return None
    return float(np.linalg.norm(plan.samples()[0, :3] - np.array(plan.reference[:3])))


def tracker_problems(
    status: TrackerStatus | None, age_s: float | None, names: Sequence[str], stale_s: float = STALE_S
) -> list[str]:
    """What the Vicon gateway reports that blocks take-off.

    Parameters
    ----------
    status, age_s
        Its newest status, if any, and the age of it.
    names
        Vehicles in question.
    stale_s
        Age from which it counts as silent.

    Returns
    -------
    list of str
        In words; empty when nothing does.
    """
    if status is None or age_s is None or age_s > stale_s:
        return [f"Vicon gateway not responding{_since(age_s)}"]
    if status.state != "up":
        return [f"Tracker: {status.trying}; does it run, and stream at tracker.address?"]
    listed = ", ".join(repr(subject.subject) for subject in status.subjects if subject.listed)
    found = []
    for subject in status.subjects:
        if subject.vehicle not in names:
            continue
        if not subject.listed:
            missing = f"{subject.vehicle}: subject {subject.subject!r} is not in the Tracker's list"
            found.append(f"{missing} (it lists: {listed or 'nothing'})")
        elif subject.ambiguous:
            found.append(f"{subject.vehicle}: the Tracker lists several subjects {subject.subject!r}")
    return found


def tracker_notes(status: TrackerStatus | None) -> list[str]:
    """Remarks of the Vicon gateway that do not block take-off.

    Parameters
    ----------
    status
        Its newest status, if any.
    """
    if status is None:
        return []
    notes = [
        f"subject {subject.subject!r} is in no vehicle"
        for subject in status.subjects
        if subject.vehicle is None and subject.listed
    ]
    return notes + ([f"raw recording: {status.recording}"] if status.recording else [])


def launcher_notes(host: str, status: LauncherStatus) -> list[str]:
    """Remarks on the processes of a host: what died, what hung, a watchdog that is off, too many vehicles.

    Parameters
    ----------
    host, status
        Name of the host, and the newest status of its launcher.
    """
    deaths = [
        f"{name} {restarts}" + (f" ({status.hung[name]} hung)" if status.hung.get(name) else "")
        for name, restarts in status.restarts.items()
        if restarts
    ]
    notes = [f"host {host}: started again: {', '.join(deaths)}"] if deaths else []
    if not status.watchdog:
        notes.append(f"host {host}: the watchdog is off, processes that hang are not replaced")
    return notes + crowded(host, status)


def crowded(host: str, status: LauncherStatus) -> list[str]:
    """A line if more agents run on a host than it serves without missed control periods, or may do so."""
    if status.measuring:
        return [f"host {host}: finds out how many vehicles it flies; a take-off waits for that"]
    if status.crowding <= 1.0:
        return []
    return [
        f"host {host}: flies about {status.flies} such vehicles, and the agents of {len(status.running)} run "
        "on it: they control at a lower rate; let some run on other hosts, or shorten their horizons"
    ]


def _since(age_s: float | None) -> str:
    return "" if age_s is None else f" for {age_s:.1f} s"
