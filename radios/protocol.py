"""The interface every radio protocol implements, in pulse widths and flags."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Literal

from msgspec import Struct

THROTTLE, AILERON, ELEVATOR, RUDDER, GEAR, AUX1 = range(6)
CHANNEL_NAMES = ("throttle", "aileron", "elevator", "rudder", "gear", "aux1")
CENTER_US = 1500.0


class ProtocolError(ValueError):
    """A frame or a setting that the radio protocol does not allow."""


class PulseRangeError(ProtocolError):
    """A pulse width that the protocol cannot carry."""


class ForbiddenInFlightError(ProtocolError):
    """A change that interrupts the radio link was asked for while the vehicle may be flying."""


class FrameDecodeError(ProtocolError):
    """Bytes that are not a frame of the protocol."""


def check_ranges(settings: object, protocol: str, **ranges: tuple[int, int]) -> None:
    """Raise `ProtocolError` for a field of a protocol's settings outside its range, the ends included."""
    for field, (lowest, highest) in ranges.items():
        value = getattr(settings, field)
        if not lowest <= value <= highest:
            raise ProtocolError(f"{protocol}.{field}: {value} is outside {lowest}..{highest}")


def check_choice(name: str, value: str, choices: Collection[str]) -> None:
    """Raise `ProtocolError` for a setting that is not among the choices."""
    if value not in choices:
        raise ProtocolError(f"{name}: {value!r} is unknown, choose one of {', '.join(choices)}")


@dataclass(frozen=True, slots=True)
class SerialLine:
    """Settings of a serial line; parity is "N", as in simulations, or "E", which no pseudo-terminal has."""

    baud: int
    parity: Literal["N", "E"] = "N"
    stop_bits: Literal[1, 2] = 1

    def duration_s(self, byte_count: int) -> float:
        """Time on the wire of `byte_count` bytes sent without gaps [s]."""
        bits = 1 + 8 + (self.parity == "E") + self.stop_bits
        return byte_count * bits / self.baud


class FrameFlags(Struct, frozen=True):
    """Requests of a frame to the radio besides the channel values."""

    bind: bool = False
    range_check: bool = False
    kill: bool = False
    low_power: bool = False


NO_FLAGS = FrameFlags()


@dataclass(frozen=True, slots=True)
class DecodedFrame:
    """Channel pulse widths [us] in the order throttle, aileron, elevator, rudder, ..., and the flags."""

    pulses_us: tuple[float, ...]
    flags: FrameFlags = NO_FLAGS


class ModuleStatus(Struct, frozen=True):
    """State of the radio module: readiness, binding, one line for people, arming."""

    ready: bool
    binding: bool
    text: str
    armed: bool | None = None
    """Whether the vehicle's firmware reports that an operator's arming lasts; None where it reports none."""


class RadioProtocol(ABC):
    """One radio: how pulse widths become bytes, when frames may be sent, what the module answers.

    A protocol object belongs to one serial port. It has no port and no clock; times are passed in.
    """

    name: ClassVar[str]
    offers: ClassVar[frozenset[str]]  # flags the radio understands
    # the radio reads the bind flag only in its first frames after it was switched on
    binds_at_power_up: ClassVar[bool] = False
    receiver_search_s: ClassVar[float] = 6.0  # longest time in which a receiver finds the radio
    serial: ClassVar[bool] = True  # whether simulated vehicles are reached by a serial line
    local_port: int = 0  # UDP port that its frames are sent from, 0 for any
    line: SerialLine
    channel_count: int
    pulse_range_us: tuple[float, float]
    # shortest possible and longest wanted time between the starts of two frames
    minimum_interval_s: float
    keepalive_s: float
    rest_us: float = CENTER_US  # pulse width of the channels that `encode` gets none for
    counters: Mapping[str, int] = MappingProxyType({})  # answers that were rejected, by reason
    watched: bool = False  # whether a watchdog of the firmware locks the vehicle without further frames

    @property
    def channels_on_air(self) -> int:
        """Number of channels that reach the vehicle."""
        return self.channel_count

    def encode(
        self, pulses_us: Sequence[float], flags: FrameFlags = NO_FLAGS, *, disarmed: bool = False
    ) -> bytes:
        """Build the next frame from throttle, aileron, elevator, rudder, gear, aux1, ...; missing ones rest.

        Raises `PulseRangeError`: a pulse width is not finite, outside `pulse_range_us`, or there are too many
        of them; `ProtocolError`: a flag the radio does not offer; kill is no such flag, throttle low does the
        same more slowly; `ForbiddenInFlightError`: `flags.bind` without `disarmed`, that is, without the
        knowledge that the vehicle does not fly.
        """
        self.check_flags(flags, disarmed=disarmed)
        return self._frame(self.check(pulses_us), flags)

    @abstractmethod
    def _frame(self, pulses_us: list[float], flags: FrameFlags) -> bytes:
        """Build the next frame from checked pulse widths of all channels, and allowed flags."""

    @abstractmethod
    def link_opened(self, now_s: float) -> None:
        """Forget everything about the module; the port was (re)opened at `now_s`."""

    @abstractmethod
    def link_resumed(self, now_s: float) -> None:
        """Open the link to a module that an earlier process found ready; so it counts until it is silent."""

    def frame_written(self, now_s: float) -> None:  # noqa: B027 - few radios use it
        """Note that a frame was written as a whole."""

    def is_address(self, port: str) -> bool:  # noqa: ARG002 - most radios are devices
        """Whether a port is an address of this radio, no device; raises `ProtocolError` for a wrong one."""
        return False

    def pose_seen(  # noqa: B027 - few firmwares use it
        self, position_m: tuple[float, float, float], yaw_rad: float, *, standing: bool
    ) -> None:
        """Pass the newest raw pose; `standing`: on the floor, and nothing is to fly it."""

    def light(self, colour: tuple[int, int, int]) -> bool:  # noqa: ARG002 - few vehicles have lights
        """Show red, green and blue, 0 to 255, from the next frames on; return whether it reaches lights."""
        return False

    def recover(self) -> str | None:
        """Begin to end a lock or a crash of the firmware in the next frames; return what, None for none."""
        return None

    def farewell(self) -> bytes:
        """Return the last frame, after which nothing feeds the firmware of a vehicle that stands."""
        return b""

    @abstractmethod
    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes the module sent; incomplete answers are kept until the rest arrives."""

    @abstractmethod
    def status(self, now_s: float) -> ModuleStatus:
        """State of the module at `now_s` from its answers."""

    def voltage_v(self, now_s: float) -> float | None:  # noqa: ARG002 - few radios report it
        """Return the voltage of the vehicle's battery at `now_s`, None if it is unknown."""
        return None

    def check(self, pulses_us: Sequence[float]) -> list[float]:
        """Check pulse widths [us] and complete them to `channel_count`; raises `PulseRangeError`."""
        if len(pulses_us) > self.channel_count:
            raise PulseRangeError(
                f"{self.name}: {len(pulses_us)} channels given, {self.channel_count} are possible"
            )
        low, high = self.pulse_range_us
        for index, pulse_us in enumerate(pulses_us):
            if not low <= pulse_us <= high:
                name = CHANNEL_NAMES[index] if index < len(CHANNEL_NAMES) else f"channel {index + 1}"
                raise PulseRangeError(
                    f"{self.name}: {name} pulse {pulse_us} us is outside {low:g}..{high:g} us"
                )
        return [*pulses_us, *([self.rest_us] * (self.channel_count - len(pulses_us)))]

    def check_flags(self, flags: FrameFlags, *, disarmed: bool = False) -> None:
        """Raise `ProtocolError` for a flag that the radio does not offer, or that is forbidden in flight."""
        if flags == NO_FLAGS:
            return
        for wish in ("bind", "range_check", "low_power"):
            if getattr(flags, wish) and wish not in self.offers:
                raise ProtocolError(f"{self.name}: {wish} cannot be asked for")
        if flags.bind and not disarmed:
            raise ForbiddenInFlightError(f"{self.name}: binding interrupts the radio link; disarm first")


class OneWayRadio(RadioProtocol):
    """A radio without answers that show its state: it is ready `settling_s` after the port was opened."""

    settling_s: float = 1.0
    _opened_s: float | None = None

    def link_opened(self, now_s: float) -> None:
        """Start the settling time."""
        self._opened_s = now_s

    def link_resumed(self, now_s: float) -> None:
        """Take the settling time for over."""
        self.link_opened(now_s)
        self._opened_s = now_s - self.settling_s

    def receive(self, data: bytes, now_s: float) -> None:
        """Ignore the bytes: this radio has no answers to understand."""

    def status(self, now_s: float) -> ModuleStatus:
        """Ready once the settling time has passed."""
        if self._opened_s is None:
            return ModuleStatus(False, False, "port not open")
        if now_s - self._opened_s < self.settling_s:
            return ModuleStatus(False, False, "settling")
        return ModuleStatus(True, False, "no answer line, assumed ready")


def ten_bit_count(pulse_us: float) -> int:
    """Spektrum 10-bit value of a pulse width."""
    return min(max(round(512 + (pulse_us - CENTER_US) / TEN_BIT_US), 0), 1023)


def ten_bit_pulse_us(count: float) -> float:
    """Pulse width [us] of a Spektrum 10-bit value."""
    return CENTER_US + (count - 512) * TEN_BIT_US


TEN_BIT_US = 1.1661
TEN_BIT_RANGE_US = (903.0, 2097.0)
