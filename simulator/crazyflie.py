"""Emulated firmware of a Crazyflie between radio and motors (behaviour: crazyflie-firmware, supervisor)."""

import math
import struct
from collections import Counter, deque
from typing import Final
from zlib import crc32

from msgspec import structs

from rcopterx.radios import crtp
from rcopterx.radios.crazyflie import CrazyflieSettings
from rcopterx.radios.crazyflie_battery import LOG
from rcopterx.radios.crtp import LONGEST_DATA, Packet
from rcopterx.radios.protocol import FrameDecodeError
from rcopterx.radios.set_points import AttitudeSetPoint
from rcopterx.simulator.crazyflie_log import ENDURANCE_S, CrazyflieLog
from rcopterx.simulator.radio_module import FRAME_LOG_LENGTH, SerialFrame
from rcopterx.simulator.vehicle_udp import UdpVehicle

PROTOCOL_VERSION: Final = 12
IDENTITY: Final = b"Bitcraze Crazyflie".ljust(LONGEST_DATA, b"\0")
BYTE: Final = 0x08
TABLE: Final = ((b"stabilizer\0estimator\0", 2), (b"stabilizer\0controller\0", 1))
"""Names and values of the parameters, all of a byte."""


def served(packet: Packet) -> Packet | None:
    """Return the answer to a request; None for one that is unknown."""
    data = packet.data
    answer: bytes | None = None
    match (packet.port, packet.channel, data[:1]):
        case (15, 0, _):
            answer = data
        case (15, 1, _):
            answer = IDENTITY
        case (13, 1, b"\0"):
            answer = bytes((0, PROTOCOL_VERSION))
        case (2, 0, b"\3"):
            answer = struct.pack("<BHI", 3, len(TABLE), crc32(repr(TABLE).encode()))
        case (2, 0, b"\2") if len(data) == 3 and (item := _item(data[1:])) is not None:
            answer = data + bytes((BYTE,)) + TABLE[item][0]
        case (2, 1, _) if len(data) == 2 and (item := _item(data)) is not None:
            answer = data + bytes((0, TABLE[item][1]))
        case (4, 0, b"\1"):
            answer = b"\1\0"
    return None if answer is None else Packet(packet.port, packet.channel, answer)


def _item(raw: bytes) -> int | None:
    item = int.from_bytes(raw, "little")
    return item if item < len(TABLE) else None


LEVEL_AFTER_S: Final = 0.5
STOP_AFTER_S: Final = 2.0
WATCHDOG_S: Final = 1.0
BOOT_S: Final = 2.0  # from a restart by radio to the first answer
SPIN_UP_S: Final = 0.3  # of motors that are checked before a brushless vehicle can fly
SPIN_UP_LIMIT_S: Final = 2.0
STANDING_S: Final = 30.0  # so long a vehicle that can fly and does not stays armed
CHECKS_S: Final = 0.3  # from then on, until it can be armed again
BLOCKED: Final = b"SUP: M3 arming RPM check (3000-12000rpm) [FAIL]\n"
LEAST_THRUST: Final = 1000 / crtp.FULL_THRUST  # less is nothing


class Crazyflie(UdpVehicle):
    """The firmware of one vehicle, without any port or clock.

    `state`: what the supervisor reports. `motors_run`: whether the motors get thrust. `rejected`: packets
    that the firmware ignored, by reason. `settings`: how set points become the pulse widths that the
    simulated vehicle gets. `arms_itself`: as brushed vehicles do; brushless ones wait for a request.
    `blocked`: whether a motor of a brushless one cannot turn. `spin_ups`: how often its motors were armed.
    `flown_s`: for how long the motors have run with this battery, which then ends.
    """

    def __init__(
        self, settings: CrazyflieSettings, start_s: float = 0.0, *, arms_itself: bool = True
    ) -> None:
        super().__init__(deque(maxlen=FRAME_LOG_LENGTH))
        self._settings = settings
        self._arms_itself = arms_itself
        self.rejected: Counter[str] = Counter()
        self.motors_run = self.blocked = False
        self.spin_ups = 0
        self.power_cycle(start_s)

    def power_cycle(self, now_s: float) -> None:
        """Start anew with a full battery, which ends every stop."""
        self.powered = True
        self._log = CrazyflieLog()
        self.flown_s = 0.0
        self._console: deque[crtp.Packet] = deque()
        self._stood_s = now_s
        self._checked_s = math.inf
        self._change(armed=self._arms_itself)
        self._unlocked = False
        self._set_point = AttitudeSetPoint()
        self._received_s = self._fed_s = math.inf
        self._advanced_s = self._running_s = now_s
        self._restarts = False

    def switch_off(self) -> None:
        """Take the battery out."""
        super().switch_off()
        self._note(self._advanced_s)

    def receive(self, raw: bytes, now_s: float) -> list[bytes]:
        """Take a packet at `now_s`; return the answers."""
        self.advance(now_s)
        if not self.powered or now_s < self._running_s:
            return []
        if raw == crtp.NULL_PACKET:
            return [crtp.NULL_PACKET]
        try:
            packet = crtp.Packet.from_bytes(raw)
            answers = self._obey(packet, now_s)
        except FrameDecodeError as error:
            self.rejected[str(error)] += 1
            return []
        self._note(now_s)
        answers += [*self._log.due(now_s, self.flown_s), *self._console]
        self._console.clear()
        return [answer.to_bytes() for answer in answers]

    def _obey(self, packet: crtp.Packet, now_s: float) -> list[crtp.Packet]:
        if packet.port == crtp.COMMANDER:
            self._take(crtp.set_point_of(packet), now_s)
            return []
        if packet == crtp.STATE_REQUEST:
            return [self.state.packet()]
        if packet == crtp.WATCHDOG:
            self._fed_s = now_s
            return []
        if packet == crtp.EMERGENCY_STOP:
            self._lock(now_s)
            return []
        if packet == crtp.RECOVERY:
            if not self.state.tumbled:
                self._change(armed=self._arms_itself)
            return []
        if packet in crtp.RESTART:
            self._restart(now_s, packet)
            return []
        if packet.port == LOG and (logged := self._log.obey(packet, now_s)) is not None:
            return [logged]
        if (answer := served(packet)) is not None:
            return [answer]
        for on in (False, True):
            if packet == crtp.arm_request(on=on):
                return [self._arm(now_s, on=on, answer=packet)]
        raise FrameDecodeError(f"crazyflie: no such port or command: {packet.port}, {packet.channel}")

    def _restart(self, now_s: float, packet: crtp.Packet) -> None:
        """Restart with the second of two packets; the battery keeps its charge."""
        begun, self._restarts = self._restarts, packet == crtp.RESTART[0]
        if begun and packet == crtp.RESTART[1]:
            flown_s = self.flown_s
            self.power_cycle(now_s)
            self.flown_s, self._running_s = flown_s, now_s + BOOT_S

    def _take(self, set_point: AttitudeSetPoint, now_s: float) -> None:
        self._unlocked = self._unlocked or set_point.thrust == 0
        self._set_point, self._received_s = set_point, now_s
        pulses_us = self._settings.pulses_us(set_point, armed=self.state.armed)
        self.frames.append(SerialFrame(now_s, pulses_us, kill=self.state.locked))

    def _arm(self, now_s: float, *, on: bool, answer: crtp.Packet) -> crtp.Packet:
        if not (self.state.locked or self.state.crashed or self.state.armed is on) and (
            not on or self.state.can_be_armed
        ):
            self._change(armed=on or self._arms_itself, spins_up=on)
            self.spin_ups += on
            self._stood_s = now_s
        done = self.state.armed is on
        data = bytes((crtp.ANSWERED | crtp.ARM, done, self.state.armed))
        return crtp.Packet(answer.port, answer.channel, data)

    def _change(self, *, armed: bool, locked: bool = False, spins_up: bool = False) -> None:
        self.state = crtp.SupervisorState(
            can_be_armed=not armed and not locked,
            armed=armed,
            arms_itself=self._arms_itself,
            can_fly=armed and not spins_up,
            locked=locked,
        )

    def _spun_up(self, now_s: float) -> None:
        if self.state.armed and not self.blocked:
            self.state = structs.replace(self.state, can_fly=True)
            self._stood_s = now_s

    def _fall_back(self, now_s: float) -> None:
        """End an arming that did not lead to a flight."""
        if self.state.armed and not self.motors_run:
            if not self.state.can_fly:
                self._console.append(crtp.Packet(crtp.CONSOLE, 0, BLOCKED[:LONGEST_DATA]))
                self._console.append(crtp.Packet(crtp.CONSOLE, 0, BLOCKED[LONGEST_DATA:]))
            self.state = crtp.SupervisorState(arms_itself=self._arms_itself)
            self._checked_s = now_s + CHECKS_S

    def _pass_checks(self, now_s: float) -> None:
        if not (self.state.armed or self.state.locked or self.state.crashed):
            self._change(armed=self._arms_itself)
            self._stood_s = now_s

    def advance(self, now_s: float) -> None:
        """Apply the ages of the set point and of the watchdog until `now_s`."""
        timers = (
            (self._received_s + LEVEL_AFTER_S, self._note),
            (self._received_s + STOP_AFTER_S, self._stop),
            (self._fed_s + WATCHDOG_S, self._lock),
            (self._stood_s + SPIN_UP_S, self._spun_up),
            (self._stood_s + (STANDING_S if self.state.can_fly else SPIN_UP_LIMIT_S), self._fall_back),
            (self._checked_s, self._pass_checks),
        )
        for due_s, act in sorted(timers, key=lambda timer: timer[0]):
            if self.powered and self._advanced_s < due_s <= now_s:
                act(due_s)
        self.flown_s += self.motors_run * max(now_s - self._advanced_s, 0.0)
        self._advanced_s = max(self._advanced_s, now_s)
        if self.powered and self.flown_s >= ENDURANCE_S:
            self.switch_off()

    def _stop(self, now_s: float) -> None:
        """Lock a vehicle that flies without commands; any other waits for thrust 0."""
        self._unlocked = False
        if self._set_point.thrust >= LEAST_THRUST and self.state.armed:
            self._lock(now_s)

    def _lock(self, now_s: float) -> None:
        self._change(armed=False, locked=True)
        self._note(now_s)

    def _note(self, now_s: float) -> None:
        """Note what the vehicle gets if it has changed."""
        point = self._set_point
        runs = self.powered and self.state.can_fly and self._unlocked and point.thrust >= LEAST_THRUST
        if not runs:
            point = AttitudeSetPoint()
        elif now_s >= self._received_s + LEVEL_AFTER_S:
            point = AttitudeSetPoint(thrust=point.thrust)
        pulses_us = self._settings.pulses_us(point, armed=self.powered and self.state.armed)
        if self.motors_run and not runs:
            self._stood_s = now_s
        self.motors_run = runs
        self.note_pulses(now_s, pulses_us)
