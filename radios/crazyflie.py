"""Crazyflie with its own firmware: attitude set points, supervisor and watchdog."""

import math
import struct
from dataclasses import dataclass
from typing import ClassVar

from msgspec import structs

from rcopterx.radios import crtp
from rcopterx.radios.crazyflie_battery import DATA_CHANNEL, LOG, BatteryLog
from rcopterx.radios.crtp import CONSOLE, PLATFORM, VERSION_CHANNEL, Packet, SupervisorState
from rcopterx.radios.protocol import FrameDecodeError, ModuleStatus, SerialLine
from rcopterx.radios.set_points import AttitudeSetPoint, FullStick, SetPointRadio

NEEDED_PROTOCOL = 12  # of firmware from 2026.04 on; older ones report no state
SILENT_S = 1.0
REARMING_S = 0.5  # for so long a vehicle that stands may be neither armed nor ready to be armed
FALL_BACKS = 2  # so many armings that the firmware ended by itself before it could fly are a refusal
COMPLAINT = "[FAIL]"  # end of lines of the console that say why the firmware does not arm
LONGEST_LINE = 120  # of which the end is kept


class FirmwareReports:
    """The newest reports of the firmware since the link was opened (crazyflie-firmware, supervisor.c).

    `state`: None before the first one. `complaint`: last line of the console that says why the firmware does
    not arm; empty before the first one, and once it can fly. `fall_backs`: armings that it ended before that.
    """

    def __init__(self) -> None:
        self.state: SupervisorState | None = None
        self.complaint = ""
        self.fall_backs = 0
        self._protocol: int | None = None
        self._line = ""
        self._answered_s = self._usable_s = self._flyable_s = -math.inf

    def resume(self, now_s: float) -> None:
        """Assume that the vehicle flies, as if it had just reported it."""
        self._answered_s = self._usable_s = self._flyable_s = now_s
        self.state = SupervisorState(armed=True, can_fly=True)

    def take(self, packet: Packet, now_s: float) -> bool:
        """Keep a report; return whether it is a state. Raises `FrameDecodeError` for a malformed one."""
        if packet.port == CONSOLE:
            self._print(packet.data.decode("ascii", "replace"))
        elif (packet.port, packet.channel) == (PLATFORM, VERSION_CHANNEL) and len(packet.data) == 2:
            self._protocol = packet.data[1]
        elif (state := SupervisorState.of(packet)) is not None:
            before, self.state, self._answered_s = self.state, state, now_s
            spun_up = before is not None and before.armed and not before.can_fly
            self.fall_backs = 0 if state.can_fly else self.fall_backs + (spun_up and not state.armed)
            if state.armed or state.can_be_armed:
                self._usable_s = now_s
            if state.can_fly:
                self._flyable_s, self.complaint = now_s, ""
            return True
        return False

    def _print(self, text: str) -> None:
        ended = (self._line + text.replace("\0", "")).split("\n")
        *lines, self._line = (line[-LONGEST_LINE:] for line in ended)
        self.complaint = next((line for line in reversed(lines) if line.endswith(COMPLAINT)), self.complaint)

    def problem(self, now_s: float, *, armed: bool, thrusts: bool) -> str | None:
        """Why the firmware would not fly; None if it would. `armed`, `thrusts`: what the frames ask for."""
        state = self.state
        if state is None:
            if self._protocol is not None and self._protocol < NEEDED_PROTOCOL:
                return f"firmware too old: protocol {self._protocol}, {NEEDED_PROTOCOL} is needed (2026.04)"
            return "no answer from the vehicle yet; check its power, channel, data rate and address"
        if now_s - self._answered_s > SILENT_S:
            return f"vehicle gone: silent for {now_s - self._answered_s:.1f} s"
        if state.locked:
            return "the vehicle is locked after a stop: reset it, or switch it off and on"
        if state.tumbled:
            return "the vehicle lies on its side: put it upright"
        if state.crashed:
            return "the vehicle has crashed: check it and reset it"
        if armed and (self.fall_backs >= FALL_BACKS or (thrusts and now_s - self._flyable_s > REARMING_S)):
            return f"the firmware did not arm: {self.complaint or 'its motors have not spun up'}"
        return None if armed or now_s - self._usable_s <= REARMING_S else "the vehicle checks itself"


FADE_EFFECT = bytes((14,))  # of the LED ring: fades to a colour
FADE_S = struct.pack("<f", 0.1)


def ring_colour(red: int, green: int, blue: int) -> list[crtp.Packet]:
    """Encode a colour of the LED ring (deck parameters, `ledring12.c`)."""
    return [
        crtp.set_parameter("ring", "effect", crtp.UINT8, FADE_EFFECT),
        crtp.set_parameter("ring", "fadeTime", crtp.FLOAT, FADE_S),
        crtp.set_parameter("ring", "fadeColor", crtp.UINT32, bytes((blue, green, red, 0))),
    ]


LINE = SerialLine(2_000_000)  # data rate on air; a Crazyflie has no serial port

FRAMES_PER_REQUEST = 10  # so often the state is asked for and the watchdog fed: every 0.25 s at the latest
REQUESTS_REMEMBERED = 20  # for the quality of the link: those of the last 4 to 5 s


@dataclass(frozen=True, slots=True)
class CrazyflieSettings(FullStick):
    """How channels become set points."""

    watchdog: bool = True
    """Feed the firmware's watchdog from the first flight on: it stops the motors 1 s after the last frame,
    until a restart of the firmware, which the gateway requests when it ends. Without it set points stop them
    after 2 s."""


class CrazyflieProtocol(SetPointRadio):
    """Driver of a Crazyflie; a frame is packets, see `crtp.joined`. `counters`: malformed answers."""

    name: ClassVar[str] = "crazyflie"
    settings: CrazyflieSettings
    separated = staticmethod(crtp.separated)
    joined = staticmethod(crtp.joined)

    def __init__(self, settings: CrazyflieSettings | None = None, line: SerialLine = LINE) -> None:
        super().__init__(settings or CrazyflieSettings(), line, REQUESTS_REMEMBERED)
        self._frames = 0
        self._armed: bool | None = None
        self._thrusts = False
        self._recovery: tuple[crtp.Packet, ...] = ()
        self._lights: list[crtp.Packet] = []  # repeated: packets are lost, and firmware restarts
        self._reports = FirmwareReports()
        self._battery = BatteryLog()

    def is_address(self, port: str) -> bool:
        """See `RadioProtocol`; no Crazyflie is behind a device."""
        return super().is_address(port) or bool(crtp.RadioAddress.of(port))

    def probe(self) -> bytes:
        """See `SetPointRadio`."""
        return crtp.NULL_PACKET

    def _set_point_frame(self, point: AttitudeSetPoint, *, armed: bool, kill: bool) -> bytes:
        """Build a frame; a kill stops the motors until the vehicle restarts."""
        packets = [crtp.set_point_packet(point)]
        if kill:
            packets.insert(0, crtp.EMERGENCY_STOP)
        self._thrusts = point.thrust > 0
        if armed is not self._armed or self._frames >= FRAMES_PER_REQUEST:
            packets += self._requests(armed=armed)
            self._armed, self._frames = armed, 0
        elif not armed and self._reports.state is not None:
            packets += filter(None, [self._battery.request()])
        self._frames += 1
        return crtp.joined(packet.to_bytes() for packet in packets)

    def _requests(self, *, armed: bool) -> list[crtp.Packet]:
        """Packets that are not needed in every frame."""
        self._answers.append(False)
        requests, reports = [crtp.STATE_REQUEST], self._reports
        state = reports.state
        if not armed:
            reports.fall_backs = 0
        if state is None:
            requests.append(crtp.VERSION_REQUEST)
        elif armed != state.armed and reports.fall_backs < FALL_BACKS and (armed or not state.arms_itself):
            requests.append(crtp.arm_request(on=armed))
        self.watched = self.watched or (armed and self.settings.watchdog)
        if self.watched:
            requests.append(crtp.WATCHDOG)
        requests += [*self._recovery, *self._lights]
        self._recovery = ()
        return requests

    def light(self, colour: tuple[int, int, int]) -> bool:
        """See `RadioProtocol`: on the LED ring, if the vehicle has this deck."""
        self._lights, self._frames = ring_colour(*colour), FRAMES_PER_REQUEST
        return True

    def recover(self) -> str | None:
        """See `RadioProtocol`: a lock ends with a restart, a crash with a request once upright."""
        state = self._reports.state
        if state is not None and state.locked:
            self._recovery, self.watched = crtp.RESTART, False
            return "the firmware restarts; it has to stand still for some seconds"
        if state is not None and state.crashed and not state.tumbled:
            self._recovery = (crtp.RECOVERY,)
            return "the firmware ends the state of its crash"
        return None

    def farewell(self) -> bytes:
        """See `RadioProtocol`: restart the firmware, whose watchdog nothing else switches off."""
        return crtp.joined(packet.to_bytes() for packet in crtp.RESTART) if self.watched else b""

    def link_opened(self, now_s: float) -> None:
        """Wait for a new state."""
        super().link_opened(now_s)
        self._armed, self._reports = None, FirmwareReports()
        self._battery = BatteryLog()

    def link_resumed(self, now_s: float) -> None:
        """Count the vehicle as ready and armed, as if it had just reported it."""
        self.link_opened(now_s)
        self._reports.resume(now_s)
        self.watched = self.settings.watchdog

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
            if packet.channel == DATA_CHANNEL:
                self._report_voltage(self._battery.voltage_v, now_s)
        elif self._reports.take(packet, now_s) and self._answers:
            self._answers[-1] = True

    def status(self, now_s: float) -> ModuleStatus:
        """See `SetPointRadio`; an arming counts once it can fly. Vehicles that arm themselves report none."""
        state = self._reports.state
        if state is None or state.arms_itself:
            return super().status(now_s)
        return structs.replace(
            super().status(now_s), armed=state.armed and (state.can_fly or not self._armed)
        )

    def _problem(self, now_s: float) -> str | None:
        return self._reports.problem(now_s, armed=self._armed is True, thrusts=self._thrusts)
