"""What happened in a fleet, read from one state of its vehicles to the next: no page, no bus."""

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from rcopterx.ground_station.scripting.state import VehicleState

KEPT: Final = 200
MERGED_S: Final = 30.0
"""What is counted goes on in the same line for so long."""
QUIET_COUNTS: Final = frozenset({"not_converged"})
"""Counted too often to be told one by one."""


@dataclass(frozen=True)
class Event:
    """One line of the time line.

    Attributes
    ----------
    time_s
        On the clock that `Timeline.compare` was given.
    vehicle
        Whom it happened to.
    text
        What happened.
    alarming
        Whether it should catch the eye.
    count
        How often it happened; 0 for what is not counted.
    """

    time_s: float
    vehicle: str
    text: str
    alarming: bool = False
    count: int = 0

    @property
    def words(self) -> str:
        """What happened, and how often."""
        return f"{self.text} × {self.count}" if self.count else self.text


class Timeline:
    """The newest events of a fleet."""

    def __init__(self) -> None:
        self.events: deque[Event] = deque(maxlen=KEPT)
        self._before: dict[str, VehicleState] = {}

    def compare(self, now_s: float, states: Mapping[str, VehicleState]) -> None:
        """Add what has changed since the last call."""
        for name, state in states.items():
            before = self._before.get(name)
            if before is not None:
                for event in changes(now_s, before, state):
                    self._add(event)
        self._before = dict(states)

    def _add(self, event: Event) -> None:
        """Add an event; what is counted goes on in a line that is not old, so that it hides nothing else."""
        if event.count:
            for number in range(len(self.events) - 1, -1, -1):
                earlier = self.events[number]
                if event.time_s - earlier.time_s > MERGED_S:
                    break
                if (earlier.vehicle, earlier.text) == (event.vehicle, event.text) and earlier.count:
                    self.events[number] = replace(earlier, count=earlier.count + event.count)
                    return
        self.events.append(event)


def changes(now_s: float, before: VehicleState, after: VehicleState) -> Iterator[Event]:
    """What happened to a vehicle between two states of it."""
    name = after.name
    if after.phase != before.phase:
        yield Event(now_s, name, f"{before.phase} → {after.phase}")
    if after.transmitter_state != before.transmitter_state and after.transmitter is not None:
        text = f"transmitter {after.transmitter.state}: {after.transmitter.reason}"
        yield Event(now_s, name, text, after.alarming)
    if before.agent is None or after.agent is None:
        return
    old, new = before.agent, after.agent
    if new.diagnostics.process != old.diagnostics.process:
        yield Event(now_s, name, "another process of its agent took over", True)
    if after.assigned != before.assigned:
        leaders = ", ".join(link.leader for link in after.assigned)
        yield Event(now_s, name, f"follows {leaders}" if leaders else "follows nobody")
    if new.following_mode != old.following_mode:
        yield Event(now_s, name, f"leader: {new.following_mode}", new.following_mode != "follow")
    for what, was, now in (
        ("controller", old.diagnostics.controller, new.diagnostics.controller),
        ("estimator", old.diagnostics.estimator, new.diagnostics.estimator),
        ("flown by", old.diagnostics.client or "its agent", new.diagnostics.client or "its agent"),
    ):
        if was != now:
            yield Event(now_s, name, f"{what} {now}")
    missed = new.diagnostics.missed_ticks - old.diagnostics.missed_ticks
    if missed > 0:
        yield Event(now_s, name, "missed control period", True, missed)
    for kind, count in new.diagnostics.fallbacks.items():
        more = count - old.diagnostics.fallbacks.get(kind, 0)
        if more > 0 and kind not in QUIET_COUNTS:
            yield Event(now_s, name, kind, count=more)
