"""The recorder process: hears everything on the bus and has it on disk a tenth of a second later."""

import signal
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import msgspec

from rcopterx.bus import channels
from rcopterx.bus.channels import CHANNELS
from rcopterx.bus.heartbeat import own_heartbeat
from rcopterx.bus.log_messages import RecorderStatus
from rcopterx.bus.realtime import request_realtime
from rcopterx.bus.session import BusAddress, RawMessage, Session
from rcopterx.flights.flight_writing import FlightSettings, FlightWriter
from rcopterx.flights.mcap_writing import LoggedMessage

FLUSH_S: Final = 0.1
"""Between two chunks; a recorder that is killed loses no more than twice this."""
REPORT_S: Final = 1.0
MAX_WAITING_BYTES: Final = 64 * 1024 * 1024
"""About a minute of three vehicles; a disk that is further behind loses messages, which are counted."""
NANO: Final = 1_000_000_000
TIME_MASK_NS: Final = 1023
"""Bits of times that are left out: a microsecond is more than is known, and zeros compress."""
FIXED_UNITS: Final = (channels.TRACKER_UNIT, channels.SIMULATOR_UNIT, channels.FLEET_UNIT)


def schemas() -> dict[str, tuple[str, bytes]]:
    """Name and JSON schema of the messages by topic, or by unit and topic where a topic has several."""
    found: dict[str, tuple[str, bytes]] = {}
    for channel in CHANNELS:
        shape = msgspec.json.encode(msgspec.json.schema(channel.message))
        fixed = channel.unit in FIXED_UNITS
        key = f"{channel.unit}/{channel.topic}" if fixed else channel.topic
        found[key] = (f"rcopterx.{channel.message.__name__}", shape)
    return found


class Gaps:
    """Finds lost messages by the counters of their senders."""

    def __init__(self) -> None:
        self.lost = 0
        self._last: dict[str, int] = {}

    def note(self, topic: str, number: int) -> None:
        """Take in the counter of a message; a sender that starts again counts from one."""
        if number == 0:
            return
        last = self._last.get(topic)
        self._last[topic] = number
        if last is not None and number > last + 1:
            self.lost += number - last - 1


class Waiting:
    """Messages between the threads that receive them and the one that writes them."""

    def __init__(self, limit_bytes: int = MAX_WAITING_BYTES) -> None:
        self._limit_bytes = limit_bytes
        self._messages: deque[RawMessage] = deque()
        self._stored_bytes = 0
        self._taken_bytes = 0
        self.dropped = 0

    def store(self, heard: RawMessage) -> None:
        """Keep a message; called on receive threads."""
        if self._stored_bytes - self._taken_bytes > self._limit_bytes:
            self.dropped += 1
            return
        self._stored_bytes += len(heard.payload)
        self._messages.append(heard)

    def take(self) -> list[RawMessage]:
        """Everything that waits, in order of arrival."""
        taken = [self._messages.popleft() for _ in range(len(self._messages))]
        self._taken_bytes += sum(len(heard.payload) for heard in taken)
        return taken


class Recorder:
    """Puts what waits into the files of a flight.

    Parameters
    ----------
    waiting, writer
        Where messages come from and go to.
    wall_ns
        Wall clock when the monotonic clock was zero: a wall clock that is set later changes nothing.
    """

    def __init__(self, waiting: Waiting, writer: FlightWriter, wall_ns: int) -> None:
        self._waiting = waiting
        self._writer = writer
        self._wall_ns = wall_ns
        self._gaps = Gaps()
        self._messages = 0
        self._recorded = {channel.topic for channel in CHANNELS if channel.recorded}

    def flush(self) -> None:
        """Write what has arrived."""
        chunk = []
        for heard in self._waiting.take():
            if heard.topic in self._recorded:
                topic = f"{heard.unit}/{heard.topic}"
                self._gaps.note(topic, heard.number)
                time_ns = self._wall_ns + round(heard.arrived_s * NANO) & ~TIME_MASK_NS
                chunk.append(LoggedMessage(topic, heard.payload, time_ns, heard.number))
        self._writer.write(chunk)
        if not self._writer.problem:
            self._messages += len(chunk)

    def status(self) -> RecorderStatus:
        """What to tell of it."""
        writer = self._writer
        return RecorderStatus(
            state="stopped" if writer.problem else "recording",
            reason=writer.problem[:400],
            file=str(writer.path or "")[:400],
            messages=self._messages,
            written_bytes=writer.written_bytes,
            lost=self._gaps.lost + self._waiting.dropped,
        )


@dataclass(frozen=True)
class RecorderSettings:
    """Settings of a recorder process.

    Attributes
    ----------
    flight
        Tells where and how it is recorded. Asked once the recorder listens: to find the commit takes time,
        and what agents are told meanwhile belongs into the log.
    """

    bus: BusAddress
    host: str
    flight: Callable[[], FlightSettings]
    wall_ns: int
    realtime_priority: int = 0


def run_recorder(settings: RecorderSettings, announce: Callable[[str], None]) -> None:
    """Record until SIGTERM or SIGINT; a disk that fails ends the recording, not the process.

    Parameters
    ----------
    settings
        Where and what.
    announce
        Told a line when the recording ends early.

    Raises
    ------
    BusUnreachableError
        No router answers.
    """
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    request_realtime(settings.realtime_priority)
    waiting = Waiting()
    with Session(settings.bus) as session:
        session.tap(waiting.store)
        # `rcopterx kill` speaks to every fleet at once.
        session.tap(waiting.store, channels.KILL.topic, channels.EVERY_FLEET)
        writer = FlightWriter(settings.flight())
        recorder = Recorder(waiting, writer, settings.wall_ns)
        session.announce(settings.host, "recorder")
        report_at_s, told = 0.0, ""
        heartbeat = own_heartbeat()
        while not stop.wait(FLUSH_S):
            heartbeat.beat()
            recorder.flush()
            if writer.problem != told:
                told = writer.problem
                announce(f"recording stopped: {told}")
            if session.clock() >= report_at_s:
                report_at_s = session.clock() + REPORT_S
                session.publish(channels.RECORDER, settings.host, recorder.status())
        heartbeat.ending()
    recorder.flush()
    writer.close()
