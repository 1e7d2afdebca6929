"""Crazyflie with its own firmware: attitude set points, supervisor and watchdog."""

from dataclasses import dataclass
from typing import ClassVar

from msgspec import structs

from rcopterx.radios import crtp
from rcopterx.radios.crazyflie_battery import DATA_CHANNEL, LOG, BatteryLog
from rcopterx.radios.crazyflie_reports import FALL_BACKS, FirmwareReports
from rcopterx.radios.protocol import FrameDecodeError, ModuleStatus, SerialLine
from rcopterx.radios.set_points import AttitudeSetPoint, FullStick, SetPointRadio

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
        elif (
            not armed and self._reports.state is not None and (wanted := self._battery.request()) is not None
        ):
            packets.append(wanted)
        self._frames += 1
        return crtp.joined(packet.to_bytes() for packet in packets)

    def _requests(self, *, armed: bool) -> list[crtp.Packet]:
        """Packets that are not needed in every frame."""
        self._answers.append(False)
        requests = [crtp.STATE_REQUEST]
        state = self._reports.state
        if not armed:
            self._reports.fall_backs = 0
        if state is None:
            requests.append(crtp.VERSION_REQUEST)
        elif (
            armed != state.armed
            and self._reports.fall_backs < FALL_BACKS
            and (armed or not state.arms_itself)
        ):
            requests.append(crtp.arm_request(on=armed))
        self.watched = self.watched or (armed and self.settings.watchdog)
        if self.watched:
            requests.append(crtp.WATCHDOG)
        requests += self._recovery
        self._recovery = ()
        return requests

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
