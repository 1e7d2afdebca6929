"""Radio protocols of vehicles whose firmware keeps the attitude and arms: what they have in common."""

import math
from abc import abstractmethod
from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from msgspec import Struct

from rcopterx.radios import protocol as base
from rcopterx.radios.udp import UDP, udp_address

FULL_STICK_US = 400.0
VOLTAGE_KEPT_S = 3.0  # vehicles report it once a second
VOLTAGES_V = (1.0, 100.0)  # others are reported by a sensor that is broken or missing
LOW_US = base.CENTER_US - FULL_STICK_US


class AttitudeSetPoint(Struct, frozen=True):
    """Roll to the right, pitch nose up, yaw clockwise from above; `thrust` is a share of the full one."""

    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    yaw_rate_deg_s: float = 0.0
    thrust: float = 0.0


@dataclass(frozen=True, slots=True)
class FullStick:
    """How channels become set points."""

    full_tilt_deg: float = 30.0
    """Roll and pitch angle at full stick."""
    full_yaw_rate_deg_s: float = 200.0
    """Yaw rate at full stick."""

    def __post_init__(self) -> None:
        for field, highest in (("full_tilt_deg", 60.0), ("full_yaw_rate_deg_s", 720.0)):
            value = getattr(self, field)
            if not 0 < value <= highest:
                raise base.ProtocolError(f"{field}: {value} must be positive and at most {highest:g}")

    def set_point(self, pulses_us: Sequence[float]) -> AttitudeSetPoint:
        """Set point of throttle, aileron, elevator and rudder [us]."""
        tilt, yaw_rate = self.full_tilt_deg / FULL_STICK_US, self.full_yaw_rate_deg_s / FULL_STICK_US
        thrust = (pulses_us[base.THROTTLE] - LOW_US) / (2 * FULL_STICK_US)
        return AttitudeSetPoint(
            tilt * (pulses_us[base.AILERON] - base.CENTER_US),
            -tilt * (pulses_us[base.ELEVATOR] - base.CENTER_US),
            yaw_rate * (pulses_us[base.RUDDER] - base.CENTER_US),
            min(max(thrust, 0.0), 1.0),
        )

    def pulses_us(self, point: AttitudeSetPoint, *, armed: bool) -> tuple[float, ...]:
        """Throttle, aileron, elevator, rudder and arming channel [us] of a set point."""
        tilt, yaw_rate = self.full_tilt_deg / FULL_STICK_US, self.full_yaw_rate_deg_s / FULL_STICK_US
        return (
            LOW_US + point.thrust * 2 * FULL_STICK_US,
            base.CENTER_US + point.roll_deg / tilt,
            base.CENTER_US - point.pitch_deg / tilt,
            base.CENTER_US + point.yaw_rate_deg_s / yaw_rate,
            base.CENTER_US + (FULL_STICK_US if armed else -FULL_STICK_US),
        )


class SetPointRadio(base.RadioProtocol):
    """Driver of one vehicle that gets set points and reports its state; the arming channel arms it."""

    offers: ClassVar[frozenset[str]] = frozenset({"kill"})
    receiver_search_s: ClassVar[float] = 0.0
    serial: ClassVar[bool] = False
    settings: FullStick  # how channels become set points

    def __init__(self, settings: FullStick, line: base.SerialLine, remembered: int) -> None:
        self.settings = settings
        self.line = line
        self.channel_count = len(base.CHANNEL_NAMES)
        self.pulse_range_us = (base.CENTER_US - 500.0, base.CENTER_US + 500.0)
        self.minimum_interval_s = 0.004
        # A little above the command period.
        self.keepalive_s = 0.025
        self.counters: Counter[str] = Counter()
        self._voltage_v: float | None = None
        self._voltage_s = -math.inf
        self.remark = ""  # further words of the status while it is ready
        self._opened = False
        self._answers: deque[bool] = deque(maxlen=remembered)

    def is_address(self, port: str) -> bool:
        """See `RadioProtocol`; also `udp://HOST:PORT`."""
        return port.startswith(UDP) and bool(udp_address(port))

    def _frame(self, pulses_us: list[float], flags: base.FrameFlags) -> bytes:
        armed = pulses_us[base.GEAR] > base.CENTER_US and not flags.kill
        point = self.settings.set_point(pulses_us) if armed else AttitudeSetPoint()
        return self._set_point_frame(point, armed=armed, kill=flags.kill)

    @abstractmethod
    def probe(self) -> bytes:
        """Return a datagram that a vehicle answers."""

    def separated(self, frame: bytes) -> list[bytes]:
        """Return the datagrams of a frame."""
        return [frame]

    def joined(self, packets: Iterable[bytes]) -> bytes:
        """Return datagrams as bytes for `receive`."""
        return b"".join(packets)

    @abstractmethod
    def _set_point_frame(self, point: AttitudeSetPoint, *, armed: bool, kill: bool) -> bytes:
        """Build the next frame; a kill stops the motors."""

    def link_opened(self, now_s: float) -> None:  # noqa: ARG002 - the interface gives the time
        """Wait for a new state."""
        self._opened = True
        self._voltage_v, self.remark = None, ""
        self._answers.clear()

    def status(self, now_s: float) -> base.ModuleStatus:
        """Ready when the firmware would fly; the text has battery and share of packets that arrived."""
        problem = self._problem(now_s) if self._opened else "port not open"
        if problem is not None:
            return base.ModuleStatus(False, False, problem)
        # The answer to the newest request may be on its way.
        judged = [*self._answers][:-1] or [True]
        link = f"link {100 * sum(judged) / len(judged):.0f} %"
        voltage_v = self.voltage_v(now_s)
        battery = "" if voltage_v is None else f"{voltage_v:.2f} V, "
        return base.ModuleStatus(True, False, f"ready, {battery}{link}{self.remark}")

    def voltage_v(self, now_s: float) -> float | None:
        """See `RadioProtocol`; unknown when the last report is old."""
        return self._voltage_v if now_s - self._voltage_s <= VOLTAGE_KEPT_S else None

    def _report_voltage(self, voltage_v: float | None, now_s: float) -> None:
        """Keep a voltage that the vehicle has reported now; one that no battery has is unknown."""
        lowest_v, highest_v = VOLTAGES_V
        plausible = voltage_v is not None and lowest_v <= voltage_v <= highest_v
        self._voltage_v, self._voltage_s = (voltage_v if plausible else None), now_s

    @abstractmethod
    def _problem(self, now_s: float) -> str | None:
        """Why the firmware would not fly; None if it would."""
