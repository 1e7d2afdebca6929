"""Crazyflie with its own firmware: attitude set points, supervisor and watchdog."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from rcopterx.transmitter_gateway.protocols import crtp
from rcopterx.transmitter_gateway.protocols.base import (
    AILERON,
    CENTER_US,
    CHANNEL_NAMES,
    ELEVATOR,
    GEAR,
    RUDDER,
    THROTTLE,
    DecodedFrame,
    FrameDecodeError,
    FrameFlags,
    ModuleStatus,
    ProtocolError,
    RadioProtocol,
    SerialLine,
)
from rcopterx.transmitter_gateway.protocols.crazyflie_battery import LOG, BatteryLog

LINE = SerialLine(2_000_000)
"""Data rate on air; a Crazyflie has no serial port."""

FULL_STICK_US = 400.0
LOW_US = CENTER_US - FULL_STICK_US
FULL_THRUST = 60_000
"""The firmware needs the rest of its 65535 for the attitude."""
FRAMES_PER_REQUEST = 10
"""So often the state is asked for and the watchdog fed: every 0.25 s at the latest."""
SILENT_S = 1.0
REQUESTS_REMEMBERED = 20
"""For the quality of the link: those of the last 4 to 5 s."""


@dataclass(frozen=True, slots=True)
class CrazyflieSettings:
    """How channels become set points.

    Parameters
    ----------
    full_tilt_deg
        Roll and pitch angle at full stick.
    full_yaw_rate_deg_s
        Yaw rate at full stick.
    watchdog
        Feed the firmware's watchdog from the first flight on: it stops the motors 1 s after the last frame,
        until a restart of the vehicle. Without it set points stop them after 2 s.
    """

    full_tilt_deg: float = 30.0
    full_yaw_rate_deg_s: float = 200.0
    watchdog: bool = True

    def __post_init__(self) -> None:
        for field, highest in (("full_tilt_deg", 60.0), ("full_yaw_rate_deg_s", 720.0)):
            value = getattr(self, field)
            if not 0 < value <= highest:
                raise ProtocolError(f"crazyflie.{field}: {value} must be positive and at most {highest:g}")

    def set_point(self, pulses_us: Sequence[float]) -> crtp.SetPoint:
        """Set point of throttle, aileron, elevator and rudder [us]."""
        tilt, yaw_rate = self.full_tilt_deg / FULL_STICK_US, self.full_yaw_rate_deg_s / FULL_STICK_US
        thrust = round((pulses_us[THROTTLE] - LOW_US) / (2 * FULL_STICK_US) * FULL_THRUST)
        return crtp.SetPoint(
            tilt * (pulses_us[AILERON] - CENTER_US),
            -tilt * (pulses_us[ELEVATOR] - CENTER_US),
            yaw_rate * (pulses_us[RUDDER] - CENTER_US),
            min(max(thrust, 0), FULL_THRUST),
        )

    def pulses_us(self, set_point: crtp.SetPoint, *, armed: bool) -> tuple[float, ...]:
        """Throttle, aileron, elevator, rudder and arming channel [us] of a set point."""
        tilt, yaw_rate = self.full_tilt_deg / FULL_STICK_US, self.full_yaw_rate_deg_s / FULL_STICK_US
        return (
            LOW_US + set_point.thrust / FULL_THRUST * 2 * FULL_STICK_US,
            CENTER_US + set_point.roll_deg / tilt,
            CENTER_US - set_point.pitch_deg / tilt,
            CENTER_US + set_point.yaw_rate_deg_s / yaw_rate,
            CENTER_US + (FULL_STICK_US if armed else -FULL_STICK_US),
        )


class CrazyflieProtocol(RadioProtocol):
    """Driver of one Crazyflie; a frame is one or more packets, see `crtp.joined`.

    The arming channel arms the firmware. `counters` counts malformed answers.
    """

    name: ClassVar[str] = "crazyflie"
    offers: ClassVar[frozenset[str]] = frozenset({"kill"})

    def __init__(self, settings: CrazyflieSettings | None = None, line: SerialLine = LINE) -> None:
        self.settings = settings or CrazyflieSettings()
        self.line = line
        self.channel_count = len(CHANNEL_NAMES)
        self.pulse_range_us = (CENTER_US - 500.0, CENTER_US + 500.0)
        self.minimum_interval_s = 0.004
        # A little above the command period; the firmware levels the vehicle after 0.5 s.
        self.keepalive_s = 0.025
        self.counters: Counter[str] = Counter()
        self._frames = 0
        self._armed: bool | None = None
        self._watched = False
        self._opened = False
        self._answered_s = -math.inf
        self._answers: deque[bool] = deque(maxlen=REQUESTS_REMEMBERED)
        self._state: crtp.SupervisorState | None = None
        self._battery = BatteryLog()

    def _frame(self, pulses_us: list[float], flags: FrameFlags) -> bytes:
        """Build a frame; a kill stops the motors until the vehicle restarts."""
        armed = pulses_us[GEAR] > CENTER_US and not flags.kill
        set_point = self.settings.set_point(pulses_us) if armed else crtp.SetPoint()
        packets = [set_point.packet()]
        if flags.kill:
            packets.insert(0, crtp.EMERGENCY_STOP)
        if armed is not self._armed or self._frames >= FRAMES_PER_REQUEST:
            packets += self._requests(armed=armed)
            self._armed, self._frames = armed, 0
        elif not armed and self._state is not None and (wanted := self._battery.request()) is not None:
            packets.append(wanted)
        self._frames += 1
        return crtp.joined(packet.to_bytes() for packet in packets)

    def _requests(self, *, armed: bool) -> list[crtp.Packet]:
        """Packets that are not needed in every frame."""
        self._answers.append(False)
        requests = [crtp.STATE_REQUEST]
        state = self._state
        if state is not None and armed != state.armed and (armed or not state.arms_itself):
            requests.append(crtp.arm_request(on=armed))
        self._watched = self._watched or (armed and self.settings.watchdog)
        if self._watched:
            requests.append(crtp.WATCHDOG)
        return requests

    def decode(self, frame: bytes) -> DecodedFrame:
        """Read a frame back; see `RadioProtocol.decode`."""
        packets = [crtp.Packet.from_bytes(raw) for raw in crtp.separated(frame)]
        points = [crtp.SetPoint.of(packet) for packet in packets if packet.port == crtp.COMMANDER]
        if len(points) != 1:
            raise FrameDecodeError(f"crazyflie: {len(points)} set points in a frame")
        kill = crtp.EMERGENCY_STOP in packets
        armed = points[0].thrust > 0
        return DecodedFrame(self.settings.pulses_us(points[0], armed=armed), FrameFlags(kill=kill))

    def link_opened(self, now_s: float) -> None:  # noqa: ARG002 - the interface gives the time
        """Wait for a new state."""
        self._opened = True
        self._armed = self._state = None
        self._answers.clear()
        self._battery = BatteryLog()

    def link_resumed(self, now_s: float) -> None:
        """Count the vehicle as ready and armed, as if it had just reported it."""
        self.link_opened(now_s)
        self._state, self._answered_s = crtp.SupervisorState(armed=True), now_s
        self._watched = self.settings.watchdog

    def receive(self, data: bytes, now_s: float) -> None:
        """Keep the newest state; other packets mean that the vehicle is there, no more."""
        try:
            answers = crtp.separated(data)
        except FrameDecodeError as error:
            self.counters[str(error)] += 1
            return
        for raw in answers:
            try:
                self._take(crtp.Packet.from_bytes(raw), now_s)
            except FrameDecodeError as error:
                self.counters[str(error)] += 1

    def _take(self, packet: crtp.Packet, now_s: float) -> None:
        if packet.port == LOG:
            self._battery.take(packet)
        elif (state := crtp.SupervisorState.of(packet)) is not None:
            self._state, self._answered_s = state, now_s
            if self._answers:
                self._answers[-1] = True

    def status(self, now_s: float) -> ModuleStatus:
        """Ready when the firmware would fly; the text has battery and share of answered requests."""
        problem = self._problem(now_s)
        if problem is not None:
            return ModuleStatus(False, False, problem)
        # The answer to the newest request may be on its way.
        judged = [*self._answers][:-1] or [True]
        link = f"link {100 * sum(judged) / len(judged):.0f} %"
        voltage_v = self._battery.voltage_v
        battery = "" if voltage_v is None else f"{voltage_v:.2f} V, "
        return ModuleStatus(True, False, f"ready, {battery}{link}")

    def _problem(self, now_s: float) -> str | None:
        state = self._state
        if not self._opened:
            return "port not open"
        if state is None:
            return "no answer from the vehicle yet; check its power, channel, data rate and address"
        if now_s - self._answered_s > SILENT_S:
            return f"vehicle gone: silent for {now_s - self._answered_s:.1f} s"
        if state.locked:
            return "the vehicle is locked after a stop: switch it off and on"
        if state.crashed or state.tumbled:
            return "the vehicle has crashed or lies on its side"
        return None if state.armed or state.can_be_armed else "the vehicle checks itself"
