"""Promises of every flight, checked while it is flown."""

import math
from collections import Counter
from collections.abc import Mapping
from itertools import combinations
from typing import Final, NamedTuple

from rcopterx.bus import channels
from rcopterx.bus.codec import decode
from rcopterx.bus.host_messages import LaboratoryVehicle
from rcopterx.bus.processes import TRACKER, TRANSMITTERS
from rcopterx.bus.session import RawMessage
from rcopterx.vehicles.tuples import Three
from rcopterx_studies.faults.flight_promises import IN_FLIGHT
from rcopterx_studies.search.flights import END, IMPAIR, STOP, Flight, Happening

TOUCHDOWN_M_S: Final = 1.0
UNSEEN_TOUCHDOWN_M_S: Final = 1.7  # as promised of landings without poses
CLOSE_M: Final = 0.3
OUTSIDE_M: Final = 0.5  # distance in which a vehicle stops
FAR_M: Final = 3.0  # the same of one that is not seen where it is
KILLED_S: Final = 0.06
ALOFT_M: Final = 0.3
MANY: Final = 2  # faults of processes and messages after which a vehicle may land by itself
DOWNWARDS: Final = ("land", "descend")  # states of the arbiter
UNSEEN: Final = frozenset({"silence", "freeze", "delay", "skip_frames", "add_noise", "close", "reset",
                           "reset_frame_id", "burst", "wrong_magic"})  # fmt: skip
"""Kinds of faults that concern the poses of all vehicles."""


class Finding(NamedTuple):
    """A promise that a flight breaks."""

    promise: str
    at_s: float
    text: str


class Watch:
    """Checks messages of a flight; `findings` are the promises that it has broken so far."""

    def __init__(self, flight: Flight, low_m: Three, high_m: Three) -> None:
        self.findings: list[Finding] = []
        self.visited: Counter[str] = Counter()
        """States and transitions of arbiters and pilots, as a measure of what was flown."""
        self._low_m, self._high_m = low_m, high_m
        self._excused, self._vehicles = excuses_of(flight), flight.vehicles
        self._touchdowns: Counter[str] = Counter()
        self._highest_m: dict[str, float] = {}
        self._states: dict[str, str] = {}
        self._doing: dict[str, str] = {}  # of agents
        self._kills: dict[str, float] = {}
        self._disturbed_s = -math.inf
        self._disturbances = 0
        self._may_land: set[str] = set()

    def note(self, happening: Happening, at_s: float) -> None:
        """Note what happens to the fleet."""
        if happening.verb in (END, STOP, IMPAIR):
            self._disturbed_s = at_s + float(happening.fields.get("seconds", 1.0)) + 1.0
            self._disturbances += 1
        if happening.verb in ("land", "disarm"):
            self._may_land.add(happening.unit)

    def landing(self, at_s: float) -> None:
        """Note that all vehicles land now; none that has to fly may be on its way down already."""
        for name, state in self._states.items():
            if state in DOWNWARDS and self._highest_m.get(name, 0.0) > ALOFT_M and self._has_to_fly(name):
                self.find("flies on", at_s, f"{name} lands ({state}), and nothing requests it")
        self._may_land |= self._states.keys()

    def killed(self, vehicle: str, at_s: float) -> None:
        """Note that a person kills a vehicle now."""
        if self._states.get(vehicle) in IN_FLIGHT and at_s > self._disturbed_s:
            self._kills[vehicle] = at_s

    def receive(self, message: RawMessage) -> None:
        """Check a message."""
        if message.topic == channels.LABORATORY.topic:
            self._check_truth(
                decode(message.payload, channels.LABORATORY.message).vehicles, message.arrived_s
            )
        elif message.topic == channels.APPLIED.topic:
            self._check_state(message)
        elif message.topic == channels.AGENT_STATUS.topic and message.unit in self._vehicles:
            self._note_agent(message)

    def find(self, promise: str, at_s: float, text: str) -> None:
        """Note a broken promise, each once."""
        if all(finding.promise != promise for finding in self.findings):
            self.findings.append(Finding(promise, round(at_s, 3), text))

    def _check_state(self, message: RawMessage) -> None:
        vehicle, state = message.unit, decode(message.payload, channels.APPLIED.message).state
        before = self._states.get(vehicle, "")
        if state != before:
            self.visited[f"{before} > {state}"] += 1
            self._states[vehicle] = state
        if state == "killed":
            self._kills.pop(vehicle, None)

    def _note_agent(self, message: RawMessage) -> None:
        """Note what an agent does while its arbiter is in a state, and how that changes."""
        status = decode(message.payload, channels.AGENT_STATUS.message)
        doing = (
            f"{status.phase}, {status.following_mode}" if status.following_mode != "follow" else status.phase
        )
        before = self._doing.get(message.unit, "")
        self._doing[message.unit] = doing
        self.visited[f"{doing} in {self._states.get(message.unit, '')}"] += 1
        if doing != before:
            self.visited[f"{before} > {doing}"] += 1

    def _check_truth(self, vehicles: Mapping[str, LaboratoryVehicle], at_s: float) -> None:
        for name, asked_s in list(self._kills.items()):
            if at_s > asked_s + KILLED_S:
                self.find("kill", at_s, f"{name} is {self._states[name]} {at_s - asked_s:.3f} s after a kill")
                del self._kills[name]
        for name, vehicle in vehicles.items():
            self._check_vehicle(name, vehicle, at_s)
        aloft = [name for name, each in vehicles.items() if not each.on_floor and name not in self._excused]
        for first, second in combinations(aloft, 2):
            apart_m = math.dist(vehicles[first].position_m, vehicles[second].position_m)
            if apart_m < CLOSE_M:
                self.find("distance", at_s, f"{first} and {second} are {apart_m:.2f} m apart")

    def _check_vehicle(self, name: str, vehicle: LaboratoryVehicle, at_s: float) -> None:
        limit_m_s = self._excused.get(name, TOUCHDOWN_M_S)
        self._highest_m.setdefault(name, 0.0)
        if vehicle.touchdowns > self._touchdowns[name]:
            self._touchdowns[name] = vehicle.touchdowns
            if vehicle.touchdown_speed_m_s > limit_m_s:
                text = f"{name} touches down with {vehicle.touchdown_speed_m_s:.2f} m/s"
                self.find("touchdown", at_s, text)
            elif self._highest_m[name] > ALOFT_M and self._has_to_fly(name):
                self.find("flies on", at_s, f"{name} comes down, and nothing requests it")
        self._highest_m[name] = max(self._highest_m[name], vehicle.position_m[2])
        sides = zip(vehicle.position_m, self._low_m, self._high_m, strict=True)
        beyond_m = max(max(low - place, place - high) for place, low, high in sides)
        if beyond_m > (FAR_M if name in self._excused else OUTSIDE_M):
            self.find("volume", at_s, f"{name} is {beyond_m:.2f} m outside the volume")

    def _has_to_fly(self, name: str) -> bool:
        return name not in self._may_land | self._excused.keys() and self._disturbances < MANY


def excuses_of(flight: Flight) -> dict[str, float]:
    """Allowed touchdown speeds [m/s] of vehicles that a flight breaks, or whose poses it takes away."""
    found: dict[str, float] = {}

    def excuse(names: tuple[str, ...], limit_m_s: float) -> None:
        for name in names:
            found[name] = max(limit_m_s, found.get(name, 0.0))

    for happening in flight.happenings:
        if happening.verb == "kill":
            excuse((happening.unit,), math.inf)
        if (happening.verb == STOP and happening.unit in (TRACKER, TRANSMITTERS)) or happening.verb == IMPAIR:
            excuse(flight.vehicles, UNSEEN_TOUCHDOWN_M_S)
        for line in happening.fields.get("faults", ()):
            fault = line["fault"]
            if fault["kind"] == "break_radio":
                excuse((fault["vehicle"],), math.inf)
            elif fault["kind"] == "stand_in":  # not protected while it climbs, but for the height
                excuse((fault["subject"],), math.inf)
            elif fault["kind"] in UNSEEN:
                excuse(flight.vehicles, UNSEEN_TOUCHDOWN_M_S)
            else:
                excuse((fault["subject"], fault.get("other", fault["subject"])), UNSEEN_TOUCHDOWN_M_S)
    return found
