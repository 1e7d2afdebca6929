"""Events of a fleet, from its messages or from the states of its vehicles."""

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import RejectedError, decode
from rcopterx.bus.log_messages import AnsweredRequest, LauncherEvent
from rcopterx.bus.message import Message
from rcopterx.bus.messages import AgentStatus, Kill, TransmitterStatus
from rcopterx.bus.requests import VERBS
from rcopterx.ground_station.scripting.state import VehicleState

EVENT_CHANNELS: Final[tuple[Channel[Any], ...]] = (
    channels.AGENT_STATUS, channels.TRANSMITTER_STATUS, channels.ANSWERED, channels.LAUNCHER_EVENT,
    channels.KILL,
)  # fmt: skip
"""Channels from which `EventFeed` reads."""
QUIET_VERBS: Final = frozenset({"recall", "prepare_leaders"})  # requests of processes, not of people
KILL_PAUSE_S: Final = 1.0  # kills are repeated while they are active; one after such a pause is another one
KEPT: Final = 60
MERGED_S: Final = 30.0  # events with the same text within this time share a line
QUIET_COUNTS: Final = frozenset({"not_converged"})  # fallbacks that happen too often to be shown


@dataclass(frozen=True)
class LoggedEvent:
    """An event of a vehicle or another unit; `count` is 0 for events that are not counted."""

    time_s: float
    vehicle: str
    text: str
    alarming: bool = False
    count: int = 0

    @property
    def words(self) -> str:
        """Text with the count."""
        return f"{self.text} × {self.count}" if self.count else self.text


class EventFeed:
    """Turns messages in their order into events."""

    def __init__(self) -> None:
        self._states: dict[str, VehicleState] = {}
        self._killed_s = float("-inf")

    def take(self, unit: str, message: Message, time_s: float) -> list[LoggedEvent]:
        """Events of a message that a unit sent, with the given time."""
        match message:
            case AgentStatus() | TransmitterStatus():
                return list(self._vehicle(unit, message, time_s))
            case AnsweredRequest():
                return list(_request(unit, message, time_s))
            case LauncherEvent():
                return [LoggedEvent(time_s, unit, message.text)]
            case Kill():
                return list(self._kill(message, time_s))
            case _:
                return []

    def _vehicle(
        self, name: str, status: AgentStatus | TransmitterStatus, time_s: float
    ) -> Iterator[LoggedEvent]:
        before = self._states.get(name, VehicleState(name))
        if isinstance(status, AgentStatus):
            first, after = before.agent is None, replace(before, agent=status)
        else:
            first, after = before.transmitter is None, replace(before, transmitter=status)
        self._states[name] = after
        if not first:
            yield from changes(time_s, before, after)

    def _kill(self, kill: Kill, time_s: float) -> Iterator[LoggedEvent]:
        if time_s - self._killed_s > KILL_PAUSE_S:
            vehicles = ", ".join(kill.vehicles) or "all vehicles"
            yield LoggedEvent(time_s, kill.source, f"KILL {vehicles}: {kill.reason}", True)
        self._killed_s = time_s


def _request(unit: str, answered: AnsweredRequest, time_s: float) -> Iterator[LoggedEvent]:
    verb = VERBS.get(answered.verb)
    if verb is None or answered.verb in QUIET_VERBS:
        return
    try:
        reply = decode(answered.reply, verb.reply)
    except RejectedError:
        return
    text = answered.verb if reply.accepted else f"{answered.verb} refused: {reply.reason}"
    yield LoggedEvent(time_s, unit, text, not reply.accepted)


@dataclass
class EventLine:
    """An event that happened to several vehicles, or several times, within `MERGED_S`."""

    text: str
    began_s: float
    newest_s: float = 0.0
    alarming: bool = False
    counts: dict[str, int] = field(default_factory=dict)  # how often, by vehicle


class Timeline:
    """The newest events of a fleet, from one set of states to the next, by the end of their lines."""

    def __init__(self) -> None:
        self.lines: deque[EventLine] = deque(maxlen=KEPT)
        self._before: dict[str, VehicleState] = {}

    def compare(self, now_s: float, states: Mapping[str, VehicleState]) -> None:
        """Add the changes since the last call."""
        for name, state in states.items():
            if (before := self._before.get(name)) is not None:
                for event in changes(now_s, before, state):
                    self.add(event)
        self._before = dict(states)

    def add(self, event: LoggedEvent) -> None:
        """Add an event, to the line with its text if that has begun a moment ago."""
        alike = (one for one in self.lines if one.text == event.text)
        line = next((one for one in alike if event.time_s - one.began_s < MERGED_S), None)
        if line is None:
            line = EventLine(event.text, event.time_s)
        else:
            self.lines.remove(line)
        line.newest_s, line.alarming = event.time_s, event.alarming
        line.counts[event.vehicle] = line.counts.get(event.vehicle, 0) + max(1, event.count)
        self.lines.append(line)


def changes(now_s: float, before: VehicleState, after: VehicleState) -> Iterator[LoggedEvent]:
    """Events of a vehicle between two states of it."""
    name = after.name
    if after.phase != before.phase:
        yield LoggedEvent(now_s, name, f"{before.phase} → {after.phase}")
    if after.transmitter_state != before.transmitter_state and after.transmitter is not None:
        text = f"transmitter {after.transmitter_state}: {after.reason}"
        yield LoggedEvent(now_s, name, text, after.alarming)
    if before.agent is None or after.agent is None:
        return
    old, new = before.agent, after.agent
    if new.diagnostics.process != old.diagnostics.process:
        yield LoggedEvent(now_s, name, "another process of its agent took over", True)
    if after.assigned != before.assigned:
        leaders = ", ".join(link.leader for link in after.assigned)
        yield LoggedEvent(now_s, name, f"follows {leaders}" if leaders else "leads")
    if new.following_mode != old.following_mode:
        yield LoggedEvent(now_s, name, f"leader: {new.following_mode}", new.following_mode != "follow")
    for what, was, now in (
        ("controller", old.diagnostics.controller, new.diagnostics.controller),
        ("estimator", old.diagnostics.estimator, new.diagnostics.estimator),
        ("flown by", old.diagnostics.client or "its agent", new.diagnostics.client or "its agent"),
    ):
        if was != now:
            yield LoggedEvent(now_s, name, f"{what} {now}")
    missed = new.diagnostics.missed_ticks - old.diagnostics.missed_ticks
    if missed > 0:
        yield LoggedEvent(now_s, name, "missed control period", True, missed)
    for kind, count in new.diagnostics.fallbacks.items():
        more = count - old.diagnostics.fallbacks.get(kind, 0)
        if more > 0 and kind not in QUIET_COUNTS:
            yield LoggedEvent(now_s, name, kind, count=more)
