"""What happens in a fleet, message by message: changes of vehicles, requests, deaths of processes, kills."""

from collections.abc import Iterator
from typing import Any, Final

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import RejectedError, decode
from rcopterx.bus.log_messages import AnsweredRequest, LauncherEvent
from rcopterx.bus.message import Message
from rcopterx.bus.messages import AgentStatus, Kill, TransmitterStatus
from rcopterx.bus.requests import VERBS
from rcopterx.ground_station.page.timeline import Event, changes
from rcopterx.ground_station.scripting.state import VehicleState

HEARD: Final[tuple[Channel[Any], ...]] = (
    channels.AGENT_STATUS, channels.TRANSMITTER_STATUS, channels.ANSWERED, channels.LAUNCHER_EVENT,
    channels.KILL,
)  # fmt: skip
"""Channels from which events are read."""
QUIET_VERBS: Final = frozenset({"recall", "recall_transmitter", "prepare_leaders"})
"""Asked by processes, not by people."""
KILL_PAUSE_S: Final = 1.0
"""Kills are repeated while they are active; one after such a pause is another one."""


class EventFeed:
    """Turns messages in their order into events."""

    def __init__(self) -> None:
        self._states: dict[str, VehicleState] = {}
        self._killed_s = float("-inf")

    def take(self, unit: str, message: Message, time_s: float) -> list[Event]:
        """Events that a message of a unit tells, with the given time."""
        match message:
            case AgentStatus() | TransmitterStatus():
                return list(self._vehicle(unit, message, time_s))
            case AnsweredRequest():
                return list(_request(unit, message, time_s))
            case LauncherEvent():
                return [Event(time_s, unit, message.text)]
            case Kill():
                return list(self._kill(message, time_s))
            case _:
                return []

    def _vehicle(self, name: str, status: AgentStatus | TransmitterStatus, time_s: float) -> Iterator[Event]:
        before = self._states.get(name, VehicleState(name, None, None, None, None, None))
        agent, transmitter = before.agent, before.transmitter
        known: Message | None
        if isinstance(status, AgentStatus):
            known, agent = agent, status
        else:
            known, transmitter = transmitter, status
        after = self._states[name] = VehicleState(name, agent, transmitter, 0.0, 0.0, None)
        if known is not None:
            yield from changes(time_s, before, after)

    def _kill(self, kill: Kill, time_s: float) -> Iterator[Event]:
        if time_s - self._killed_s > KILL_PAUSE_S:
            whom = ", ".join(kill.vehicles) or "everybody"
            yield Event(time_s, kill.source, f"KILL {whom}: {kill.reason}", True)
        self._killed_s = time_s


def _request(unit: str, answered: AnsweredRequest, time_s: float) -> Iterator[Event]:
    verb = VERBS.get(answered.verb)
    if verb is None or answered.verb in QUIET_VERBS:
        return
    try:
        reply = decode(answered.reply, verb.reply)
    except RejectedError:
        return
    text = answered.verb if reply.accepted else f"{answered.verb} refused: {reply.reason}"
    yield Event(time_s, unit, text, not reply.accepted)
