"""The recorder process: writes all messages on the bus to disk within a tenth of a second."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rcopterx.bus import channels
from rcopterx.bus.channels import CHANNELS
from rcopterx.bus.clock import NANO
from rcopterx.bus.heartbeat import own_heartbeat
from rcopterx.bus.log_messages import RecorderStatus
from rcopterx.bus.processes import RECORDER
from rcopterx.bus.realtime import ending_signals, request_realtime
from rcopterx.bus.session import BusAddress, RawMessage, Session
from rcopterx.flights.flight_writing import FlightSettings, FlightWriter
from rcopterx.flights.mcap_writing import LoggedMessage

FLUSH_S: Final = 0.1  # time between two chunks; a recorder that is killed loses no more than twice this
REPORT_S: Final = 1.0
MAX_WAITING_BYTES: Final = 64 * 1024 * 1024  # about a minute of three vehicles; more is dropped and counted
TIME_MASK_NS: Final = 1023  # cleared bits of times, which compress as zeros, below their accuracy


class Gaps:
    """Counts lost messages by the counters of their senders."""

    def __init__(self) -> None:
        self.lost = 0
        self._last: dict[str, int] = {}

    def note(self, topic: str, number: int) -> None:
        """Add the counter of a message; a sender that restarts counts from one."""
        if number == 0:
            return
        last = self._last.get(topic)
        self._last[topic] = number
        if last is not None and number > last + 1:
            self.lost += number - last - 1


class Waiting:
    """Messages between the threads that receive them and the one that writes them."""

    def __init__(self) -> None:
        self._messages: deque[RawMessage] = deque()
        self._stored_bytes = 0
        self._taken_bytes = 0
        self.dropped = 0

    def store(self, message: RawMessage) -> None:
        """Keep a message; called on receive threads."""
        if self._stored_bytes - self._taken_bytes > MAX_WAITING_BYTES:
            self.dropped += 1
            return
        self._stored_bytes += len(message.payload)
        self._messages.append(message)

    def take(self) -> list[RawMessage]:
        """Remove and return all messages in order of arrival."""
        taken = [self._messages.popleft() for _ in range(len(self._messages))]
        self._taken_bytes += sum(len(message.payload) for message in taken)
        return taken


class Recorder:
    """Writes waiting messages into the files of a flight, at times from `wall_ns` at monotonic zero on."""

    def __init__(self, waiting: Waiting, writer: FlightWriter, wall_ns: int) -> None:
        self._waiting = waiting
        self._writer = writer
        self._wall_ns = wall_ns
        self._gaps = Gaps()
        self._messages = self._unwritten = 0
        self._recorded = {channel.topic for channel in CHANNELS if channel.recorded}

    def flush(self) -> None:
        """Write the messages that have arrived."""
        chunk = []
        for message in self._waiting.take():
            if message.topic in self._recorded:
                topic = f"{message.unit}/{message.topic}"
                self._gaps.note(topic, message.number)
                time_ns = self._wall_ns + round(message.arrived_s * NANO) & ~TIME_MASK_NS
                chunk.append(LoggedMessage(topic, message.payload, time_ns, message.number))
        self._writer.write(chunk)
        if self._writer.problem:
            self._unwritten += len(chunk)
        else:
            self._messages += len(chunk)

    def status(self) -> RecorderStatus:
        """Return the present status."""
        writer = self._writer
        return RecorderStatus(
            state="stopped" if writer.problem else "recording",
            reason=writer.problem[:400],
            file=str(writer.path or "")[:400],
            messages=self._messages,
            written_bytes=writer.written_bytes,
            lost=self._gaps.lost + self._waiting.dropped + self._unwritten,
        )


@dataclass(frozen=True)
class RecorderSettings:
    """Settings of a recorder process; `flight`, which takes time, is called once it has subscribed."""

    bus: BusAddress
    host: str
    flight: Callable[[], FlightSettings]
    wall_ns: int
    realtime_priority: int = 0


def run_recorder(settings: RecorderSettings, announce: Callable[[str], None]) -> None:
    """Record until SIGTERM or SIGINT; the disk's failures interrupt it, with lines for `announce`."""
    signals = ending_signals()
    request_realtime(settings.realtime_priority)
    waiting = Waiting()
    with Session(settings.bus) as session:
        session.tap(waiting.store)
        # `rcopterx kill` uses keys of every fleet.
        session.tap(waiting.store, channels.KILL.topic, channels.EVERY_FLEET)
        session.take_no_turns(RECORDER)
        writer = FlightWriter(settings.flight())
        recorder = Recorder(waiting, writer, settings.wall_ns)
        report_at_s, stopped = 0.0, False
        heartbeat = own_heartbeat()
        while not signals:
            time.sleep(FLUSH_S)
            heartbeat.beat()
            recorder.flush()
            if bool(writer.problem) != stopped:
                stopped = not stopped
                announce(f"recording stopped: {writer.problem}" if stopped else "recording resumed")
            if session.clock() >= report_at_s:
                report_at_s = session.clock() + REPORT_S
                session.publish(channels.RECORDER, settings.host, recorder.status())
        heartbeat.ending()
    recorder.flush()
    writer.close()
