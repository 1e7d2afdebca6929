"""Common part of emulated radio modules: serial line with wire time, frame ends, air packets, frame log."""

import math
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from msgspec import Struct

from rcopterx.simulator.plant import Plant
from rcopterx.vehicles.model import Model

FRAME_LOG_LENGTH = 1000

Timer = tuple[float, Callable[[float], None]]


class SerialFrame(Struct, frozen=True):
    """A frame that the module accepted: arrival of its last byte, and its channels."""

    arrival_s: float
    pulses_us: tuple[float, ...]
    kill: bool = False
    bind: bool = False


class Reception(ABC):
    """A radio by what it accepted, its `frames`, newest last, and what its vehicle got of them."""

    def __init__(self, frames: deque[SerialFrame]) -> None:
        self.powered = True
        self.frames = frames
        self.light: tuple[int, int, int] | None = None  # red, green, blue of its LEDs; None for their own
        self._outputs: deque[tuple[float, tuple[float, ...]]] = deque(maxlen=FRAME_LOG_LENGTH)
        self._last: tuple[float, ...] | None = None

    def note_pulses(self, time_s: float, pulses_us: tuple[float, ...]) -> None:
        """Note what the vehicle gets if it has changed."""
        if pulses_us != self._last:
            self._last = pulses_us
            self._outputs.append((time_s, pulses_us))

    def take_outputs(self) -> list[tuple[float, tuple[float, ...]]]:
        """Return and forget when the vehicle has got other pulse widths, and which [us]."""
        outputs = list(self._outputs)
        self._outputs.clear()
        return outputs

    def take_frames(self) -> list[SerialFrame]:
        """Return and forget the frames that were accepted."""
        frames = list(self.frames)
        self.frames.clear()
        return frames

    @abstractmethod
    def power_cycle(self, now_s: float) -> None:
        """Switch on, or restart."""

    def switch_off(self) -> None:
        """Take the power away."""
        self.powered = False

    def body_of(self, model: Model) -> Model:
        """Return the body of a vehicle that flies like a model, as the firmware of this radio moves it."""
        return model

    def sense(self, plant: Plant) -> None:  # noqa: B027 - few vehicles report it
        """Measure the pose of the vehicle, whose body is `plant`."""


class AirPacket(Struct, frozen=True):
    """Packet that a module sends to receivers."""

    time_s: float
    rf_channels: int  # identifies the two radio channels in use; changes whenever the module picks new ones
    model_match: int
    pulses_us: tuple[float, ...]  # as a receiver decodes them; meaningless when binding
    bind: bool = False
    weak: bool = False  # with range-check power


@dataclass(slots=True)
class SerialInput:
    """Bytes of a serial line, `byte_s` each; a burst ends after a pause of `end_of_frame_s`."""

    byte_s: float
    end_of_frame_s: float
    end_s: float = -math.inf
    _data: bytearray = field(default_factory=bytearray)
    _bursts: deque[tuple[float, bytes]] = field(default_factory=deque)

    def feed(self, data: bytes, now_s: float) -> None:
        """Receive bytes whose transmission starts at `now_s`, or when the line is free."""
        start_s = max(self.end_s, now_s)
        if self._data and start_s + self.byte_s > self.end_s + self.end_of_frame_s:
            self._close()
        self._data += data
        self.end_s = start_s + len(data) * self.byte_s

    def _close(self) -> None:
        self._bursts.append((self.end_s, bytes(self._data)))
        self._data.clear()

    def next_end_s(self) -> float:
        """When the next burst is recognised as ended [s], infinite without one."""
        if self._bursts:
            return self._bursts[0][0] + self.end_of_frame_s
        return self.end_s + self.end_of_frame_s if self._data else math.inf

    def take(self) -> tuple[float, bytes]:
        """Remove the oldest burst; return when its last byte arrived [s], and its bytes."""
        if not self._bursts:
            self._close()
        return self._bursts.popleft()


class RadioModule(ABC):
    """State machine over timestamped bytes without a clock; `advance` advances the time."""

    def __init__(self, byte_s: float, end_of_frame_s: float, frame_length: int) -> None:
        self.frame_length = frame_length
        self._input = SerialInput(byte_s, end_of_frame_s)
        self.frames: deque[SerialFrame] = deque(maxlen=FRAME_LOG_LENGTH)  # accepted frames, newest last
        self.rejected: Counter[str] = Counter()  # frames and bytes that were not accepted, by reason
        self._packets: list[AirPacket] = []
        self._answers = bytearray()

    @property
    def shortest_spacing_s(self) -> float:
        """Shortest time between the starts of two frames that the module distinguishes."""
        return self.frame_length * self._input.byte_s + self._input.end_of_frame_s

    @abstractmethod
    def power_cycle(self, now_s: float) -> None:
        """Restart, as after a brown-out or a replugged cable."""

    @abstractmethod
    def _on_burst(self, end_s: float, data: bytes) -> None:
        """Take the bytes between two pauses; the last one arrived at `end_s`."""

    @abstractmethod
    def _timers(self) -> list[Timer]:
        """Next times at which the module acts by itself, and its actions."""

    def feed(self, data: bytes, now_s: float) -> None:
        """Take bytes put on the line at `now_s`."""
        self._input.feed(data, now_s)

    def advance(self, now_s: float) -> bytes:
        """Do everything due until `now_s`; return the bytes the module answers."""
        while True:
            time_s, handler = min(self._timers(), key=lambda timer: timer[0])
            burst_s = self._input.next_end_s()
            if burst_s <= time_s:
                time_s, handler = burst_s, lambda _now_s: self._on_burst(*self._input.take())
            if time_s > now_s:
                break
            handler(time_s)
        answers = bytes(self._answers)
        self._answers.clear()
        return answers

    def take_packets(self) -> list[AirPacket]:
        """Return and forget the packets sent since the last call."""
        packets, self._packets = self._packets, []
        return packets

    def _reset_line(self) -> None:
        self._input = SerialInput(self._input.byte_s, self._input.end_of_frame_s)


class RadioEnd(ABC):
    """A radio and its receiver: `receive` when `fileno` is readable, `advance` often, for time limits."""

    def __init__(self, reception: Reception) -> None:
        self.reception = reception

    @property
    def is_open(self) -> bool:
        """False while unplugged or closed."""
        return self.fileno() >= 0

    @abstractmethod
    def fileno(self) -> int:
        """Descriptor to wait for written bytes on, -1 while unplugged."""

    @abstractmethod
    def receive(self, now_s: float) -> None:
        """Read what was written."""

    @abstractmethod
    def advance(self, now_s: float) -> None:
        """Advance the time."""

    @abstractmethod
    def unplug(self, *, powered: bool = False) -> None:
        """Remove the port, as a cable that is pulled; `powered` if the radio has power of its own."""

    @abstractmethod
    def replug(self, now_s: float) -> None:
        """Plug the cable in again; a radio that was without power boots."""

    def switch_off(self) -> None:
        """Take the power away; the port stays."""
        self.reception.switch_off()

    def switch_on(self, now_s: float) -> None:
        """Give the power back; it boots."""
        if not self.reception.powered:
            self.reception.power_cycle(now_s)
