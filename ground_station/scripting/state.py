"""The state of a vehicle at one moment, and what keeps it from taking off or from its place."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from rcopterx.agents.load import LATE_SHARE
from rcopterx.bus.messages import AgentStatus, Battery, LeaderLink, Plan, TransmitterStatus
from rcopterx.vehicles.phases import AIRBORNE

LONG_AGO_S: Final = 120.0  # ages from here on are given in minutes
STALE_S: Final = 1.0
"""Age from which a status blocks take-off; statuses come five times a second."""
SILENT_S: Final = 0.5
"""Age from which displays show an agent as silent."""
ALARMING_STATES: Final = frozenset({"hold", "descend", "land", "cut", "killed"})
"""States of the arbiter in which the agent does not fly the vehicle."""
OFFSET_TOLERANCE_M: Final = 0.001
YAW_TOLERANCE_RAD: Final = 0.2


def shown_heading_deg(yaw_rad: float) -> int:
    """Return a heading within half a turn of 0, in (-180, 180], for people."""
    heading_deg = round(math.degrees(math.remainder(yaw_rad, math.tau)))
    return 180 if heading_deg == -180 else heading_deg


@dataclass(frozen=True, repr=False)
class VehicleState:
    """The state of a vehicle at one moment; prints as one line. Ages are on the local monotonic clock.

    `agent` and `transmitter` are the newest statuses, None before the first. `pose_age_s` is the age of the
    newest message of the motion capture that the agent received, whether the vehicle was seen or not;
    `seen_age_s` is the time since the vehicle was last seen. `plan`, `seen_at_m` and `quaternion_xyzw`, as
    the motion capture sees the vehicle, are None unless motion is watched (`Fleet.watch_motion`).
    `latency_ms` has percentiles by stage of `report.latency`, and is empty unless latency is watched.
    """

    name: str
    agent: AgentStatus | None = None
    transmitter: TransmitterStatus | None = None
    agent_age_s: float | None = None
    transmitter_age_s: float | None = None
    pose_age_s: float | None = None
    seen_age_s: float | None = None
    plan: Plan | None = None
    seen_at_m: tuple[float, float, float] | None = None
    quaternion_xyzw: tuple[float, float, float, float] | None = None
    latency_ms: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def phase(self) -> str:
        """Flight phase, `unknown` without a status."""
        return "unknown" if self.agent is None else self.agent.phase

    @property
    def silent(self) -> bool:
        """Whether the agent has not reported for half a second."""
        return self.agent_age_s is None or self.agent_age_s > SILENT_S

    @property
    def flown_by(self) -> str:
        """The external program that flies it, else the name of its controller; empty without a status."""
        if self.agent is None:
            return ""
        client = self.agent.diagnostics.client
        return f"{client} (external)" if client else self.agent.diagnostics.controller

    @property
    def host(self) -> str | None:
        """Host on which its agent runs; None without a status."""
        return None if self.agent is None else self.agent.host

    @property
    def transmitter_state(self) -> str:
        """State of the arbiter, `unknown` without a status."""
        return "unknown" if self.transmitter is None else self.transmitter.state

    @property
    def battery(self) -> Battery | None:
        """Its battery: voltage, remaining flight time and so on; None if its radio does not report it."""
        return None if self.transmitter is None else self.transmitter.battery

    @property
    def battery_text(self) -> str:
        """Voltage of its battery, and how long it still flies, in words; empty if unknown."""
        if (battery := self.battery) is None:
            return ""
        text = f"{battery.voltage_v:.2f} V" + ", charged" * battery.charged
        if battery.left_s is None:
            return text
        return f"{text}, {battery.left_s[0] / 60.0:.1f} min left, at most {battery.left_s[1] / 60.0:.1f}"

    @property
    def firmware_armed(self) -> bool | None:
        """Whether the firmware of the vehicle reports that it is armed; None if it reports none."""
        return None if self.transmitter is None else self.transmitter.armed

    @property
    def reason(self) -> str:
        """Why the arbiter is in its state, without the name of the state; empty without a status."""
        if self.transmitter is None:
            return ""
        return self.transmitter.reason.removeprefix(f"{self.transmitter.state}: ")

    @property
    def airborne(self) -> bool:
        """Whether the vehicle is in the air according to its agent."""
        return self.phase in AIRBORNE

    @property
    def position_m(self) -> tuple[float, float, float] | None:
        """Position according to its agent; None while it is unknown."""
        return None if self.agent is None else self.agent.position_m

    @property
    def place_m(self) -> tuple[float, float, float] | None:
        """Position where motion is watched: in flight of the newest plan, which is newer than the status."""
        if self.plan is None or not self.plan.airborne:
            return self.position_m
        x, y, z = self.plan.trajectory.to_numpy()[0, :3].tolist()
        return x, y, z

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
        """Leaders with the offsets it was given, also while an offset is in transition."""
        return () if self.agent is None else self.agent.assigned

    @property
    def learned(self) -> str:
        """Which parts of its model it has learned in this flight, and since when it uses them."""
        values = None if self.agent is None else self.agent.diagnostics
        if values is None or not values.learned or values.learned_age_s is None:
            return ""
        age_s = values.learned_age_s
        ago = f"{age_s:.0f} s" if age_s < LONG_AGO_S else f"{age_s / 60.0:.0f} min"
        return f"learned {ago} ago: {', '.join(values.learned)}"

    @property
    def remarks(self) -> str:
        """What its agent remarks, as the reason of a landing; empty without a remark."""
        return "" if self.agent is None else "; ".join(self.agent.diagnostics.remarks)

    @property
    def error_m(self) -> float | None:
        """Distance from the reference according to the agent; None on the floor."""
        if self.plan is not None:
            return error_of(self.plan)
        return None if self.agent is None else self.agent.error_m

    @property
    def event_counts(self) -> Counter[str]:
        """Fallbacks and rejected messages of agent and transmitter gateway, by kind."""
        counts: Counter[str] = Counter()
        if self.agent is not None:
            counts.update(self.agent.diagnostics.fallbacks)
            counts.update(self.agent.diagnostics.rejected)
        if self.transmitter is not None:
            counts.update(self.transmitter.rejected)
        return +counts

    def __str__(self) -> str:
        words = [self.phase, f"transmitter {self.transmitter_state}"]
        if self.agent is not None:
            words.append(f"flown by {self.flown_by}")
            words.append(f"follows {', '.join(self.leaders)}" if self.leaders else "leads")
            if self.position_m is not None:
                x, y, z = self.position_m
                words.append(f"at {x:.2f} {y:.2f} {z:.2f} m")
            if self.agent.yaw_rad is not None:
                words.append(f"heading {shown_heading_deg(self.agent.yaw_rad)} deg")
        if self.error_m is not None:
            words.append(f"error {1000 * self.error_m:.0f} mm")
        words += filter(None, [self.battery_text])
        return f"{self.name}: {', '.join(words)}"

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self}>"

    def summary(self) -> str:
        """Phase and state of the transmitter with its reason."""
        if self.transmitter is None:
            return f"{self.name}: {self.phase}"
        waits = self.transmitter.state == "armed" and self.transmitter.armed is False
        firmware = f"; not by its firmware: {self.transmitter.module}" if waits else ""
        return f"{self.name}: {self.phase}, transmitter {self.transmitter.state}: {self.reason}{firmware}"

    def problems(self, stale_s: float = STALE_S) -> list[str]:
        """Problems that block take-off, one line each."""
        found = []
        if self.agent is None or self.agent_age_s is None or self.agent_age_s > stale_s:
            found.append(f"{self.name}: agent not responding{since(self.agent_age_s)}")
        elif self.agent.pose_age_s is None or self.agent.pose_age_s > stale_s:
            found.append(f"{self.name}: no pose{since(self.agent.pose_age_s)}")
        elif self.seen_age_s is None or self.seen_age_s > stale_s:
            found.append(f"{self.name}: the motion capture does not see it{since(self.seen_age_s)}")
        elif (late_share := self.agent.late_share) > LATE_SHARE and not self.airborne:
            found.append(
                f"{self.name}: {late_share:.0%} of its commands are late while it stands; fly fewer vehicles "
                "on this computer, or end other programs"
            )
        if self.transmitter is None or self.transmitter_age_s is None or self.transmitter_age_s > stale_s:
            found.append(f"{self.name}: transmitter gateway not responding{since(self.transmitter_age_s)}")
        elif not self.transmitter.ready:
            found.append(f"{self.name}: transmitter not ready: {self.transmitter.module}")
        elif self.transmitter.state == "killed":
            found.append(f"{self.name}: killed ({self.reason}); reset it first")
        elif self.transmitter.state == "cut" and self.reason.startswith("lift-off"):
            found.append(f"{self.name}: the last take-off failed ({self.reason}); mend it, then disarm it")
        if self.transmitter is not None and not self.airborne:
            found += self.transmitter.pose_problems
        return found


def error_of(plan: Plan) -> float | None:
    """Distance of the beginning of a plan from its reference [m]; None on the floor."""
    if plan.reference is None or not plan.airborne:
        return None
    return float(np.linalg.norm(plan.trajectory.to_numpy()[0, :3] - np.array(plan.reference[:3])))


def formation_problem(state: VehicleState, tolerance_m: float) -> str:
    """Why a follower is not in formation; empty if it is."""
    agent, error_m = state.agent, state.error_m
    if not state.assigned:
        return f"{state.name}: does not follow any vehicle"
    if agent is None or error_m is None or not agent.following:
        return f"{state.name}: {state.phase}, does not follow now"
    present = {link.leader: link.offset_m for link in agent.following}
    for link in state.assigned:
        if link.leader not in present:
            return f"{state.name}: does not follow {link.leader} now"
        if math.dist(link.offset_m, present[link.leader]) > OFFSET_TOLERANCE_M:
            return f"{state.name}: still on its way to its new offset"
    if error_m > tolerance_m:
        return f"{state.name}: {1000 * error_m:.0f} mm from its place"
    return ""


def arrival_problem(state: VehicleState, tolerance_m: float) -> str:
    """How far a vehicle is from its set point; empty if it is there."""
    agent = state.agent
    if agent is None or agent.position_m is None or agent.yaw_rad is None or state.phase != "flying":
        return f"{state.name}: {state.phase}"
    distance_m = math.dist(agent.position_m, agent.set_point.position_m)
    turn_rad = abs(agent.yaw_rad - agent.set_point.yaw_rad)
    if distance_m > tolerance_m:
        return f"{state.name}: {1000 * distance_m:.0f} mm from its set point"
    if turn_rad > YAW_TOLERANCE_RAD:
        return f"{state.name}: {math.degrees(turn_rad):.0f} deg from its heading"
    return ""


def since(age_s: float | None) -> str:
    """How long a problem lasts, to append to it; empty where that is unknown."""
    return "" if age_s is None else f" for {age_s:.1f} s"
