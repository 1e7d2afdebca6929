"""Emulated firmware of a Crazyflie between radio and motors (behaviour: crazyflie-firmware, supervisor)."""

import math
import struct
from collections import Counter, deque
from typing import Final
from zlib import crc32

from rcopterx.radios import crazyflie_battery as log
from rcopterx.radios import crtp
from rcopterx.radios.crazyflie import FADE_EFFECT, CrazyflieSettings
from rcopterx.radios.crazyflie_battery import LOG
from rcopterx.radios.crtp import LONGEST_DATA, Packet
from rcopterx.radios.protocol import FrameDecodeError
from rcopterx.radios.set_points import AttitudeSetPoint
from rcopterx.simulator.crazyflie_supervisor import PERIOD_S, STANDING_G, FirmwareSupervisor
from rcopterx.simulator.first_order_plant import thrust_acceleration
from rcopterx.simulator.plant import Plant
from rcopterx.simulator.radio_module import FRAME_LOG_LENGTH, SerialFrame
from rcopterx.simulator.vehicle_udp import UdpVehicle
from rcopterx.vehicles.state import GRAVITY_M_S2

HOVER_DROP_V: Final = 0.35  # 2 A by 0.19 ohm: wiki.bitcraze.io, misc:investigations:thrust
LEAST_CHARGE: Final = 0.005
TABLE: Final = (b"stabilizer\0roll\0", log.VARIABLE, b"stabilizer\0yaw\0")
NO_SUCH: Final = 2
INVALID: Final = 22
RING: Final = {b"effect": crtp.UINT8, b"fadeTime": crtp.FLOAT, b"fadeColor": crtp.UINT32}  # types


def battery_voltage_v(used: float, load: float) -> float:
    """Return the voltage of a battery that has lost a share of its charge, under a load (1 for a hover).

    At rest by Tremblay, Dessaint and Dekkiche 2007, equation (1), with their figures of a Li-ion cell.
    """
    rest_v = 3.7348 - 0.00876 / max(1.0 - used, LEAST_CHARGE) + 0.468 * math.exp(-3.5294 * used)
    return max(rest_v - HOVER_DROP_V * load, 0.0)


class CrazyflieLog:
    """Blocks of one variable, lost when the vehicle starts anew."""

    def __init__(self) -> None:
        self._blocks: dict[int, tuple[int, float, float]] = {}  # variable, period [s], next time [s]

    def obey(self, packet: Packet, now_s: float) -> Packet | None:
        """Return the answer to a request; None for one that is unknown or too short."""
        data = packet.data
        match (packet.channel, *data):
            case (log.TABLE_CHANNEL, log.GET_INFO, *_):
                answer = struct.pack("<BHIBB", log.GET_INFO, len(TABLE), crc32(b"".join(TABLE)), 16, 128)
            case (log.TABLE_CHANNEL, log.GET_ITEM, _, _):
                item = int.from_bytes(data[1:], "little")
                answer = data + (bytes((log.FLOAT,)) + TABLE[item] if item < len(TABLE) else b"")
            case (log.CONTROL_CHANNEL, _, _, _, *_):
                answer = data[:2] + bytes((self._control(data, now_s),))
            case _:
                return None
        return Packet(log.LOG, packet.channel, answer)

    def _control(self, data: bytes, now_s: float) -> int:
        command, block = data[:2]
        if command == log.CREATE_BLOCK and len(data) == 5:
            if block in self._blocks:
                return log.STARTED_BEFORE
            variable = int.from_bytes(data[3:], "little")
            if variable >= len(TABLE):
                return NO_SUCH
            self._blocks[block] = variable, 0.0, math.inf
            return log.NEW
        if command == log.START_BLOCK and block in self._blocks:
            self._blocks[block] = self._blocks[block][0], 0.01 * data[2], now_s
            return log.NEW
        return NO_SUCH

    def due(self, now_s: float, voltage_v: float) -> list[Packet]:
        """Return the data that are due."""
        packets, stamp = [], (round(1000 * now_s) % 2**24).to_bytes(3, "little")
        for block, (variable, period_s, due_s) in self._blocks.items():
            if now_s >= due_s:
                self._blocks[block] = variable, period_s, now_s + period_s
                value = voltage_v if TABLE[variable] == log.VARIABLE else math.nan
                data = bytes((block,)) + stamp + struct.pack("<f", value)
                packets.append(Packet(log.LOG, log.DATA_CHANNEL, data))
        return packets


PROTOCOL_VERSION: Final = 12
ARMING: Final = crtp.arm_request(on=False), crtp.arm_request(on=True)
BOOT_S: Final = 2.0  # from a restart by radio to the first answer
STATES_OF_START: Final = 4  # until it is armed, or can be
BLOCKED: Final = b"SUP: M3 arming RPM check (1000-3500rpm) [FAIL]\n"
LEAST_THRUST: Final = 1000 / crtp.FULL_THRUST  # less is nothing: `MIN_THRUST`
IDLE_THRUST: Final = 7000 / crtp.FULL_THRUST  # of a brushless one: `MOTORS_DEFAULT_IDLE_THRUST`


class Crazyflie(UdpVehicle):
    """The firmware of one vehicle, without any port or clock.

    `state`: what the supervisor reports. `supervisor`: decides whether motors may run. `motors_run`: whether
    they get thrust. `rejected`: packets that the firmware ignored, by reason. `settings`: how set points
    become the pulse widths that the simulated vehicle gets. `arms_itself`: as brushed vehicles do; brushless
    ones wait for a request. `voltage_v`: of the battery, as it was last measured.
    """

    def __init__(
        self, settings: CrazyflieSettings, start_s: float = 0.0, *, arms_itself: bool = True
    ) -> None:
        super().__init__(deque(maxlen=FRAME_LOG_LENGTH))
        self._settings = settings
        self._arms_itself = arms_itself
        self.rejected: Counter[str] = Counter()
        self.motors_run = False
        self.power_cycle(start_s)

    def power_cycle(self, now_s: float) -> None:
        """Start anew with a full battery, which ends every stop."""
        self.powered = True
        self._log, self.voltage_v, self._renewed = CrazyflieLog(), battery_voltage_v(0.0, 0.0), True
        self._console: deque[crtp.Packet] = deque()
        self._ring, self.light = dict[bytes, bytes](), None
        self._unlocked = self._restarts = False
        self._set_point, self._received_s = AttitudeSetPoint(), -math.inf
        self._advanced_s = self._running_s = now_s
        self._sensed: tuple[float, ...] | None = None
        self._next_s = now_s - STATES_OF_START * PERIOD_S
        self.supervisor = FirmwareSupervisor(self._next_s, arms_itself=self._arms_itself)
        self._supervise(now_s)

    @property
    def state(self) -> crtp.SupervisorState:
        """As the supervisor reports it."""
        return self.supervisor.report

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
            answers = self._obey(crtp.Packet.from_bytes(raw), now_s)
        except FrameDecodeError as error:
            self.rejected[str(error)] += 1
            return []
        self._note(now_s)
        answers += [*self._log.due(now_s, self.voltage_v), *self._console]
        self._console.clear()
        return [answer.to_bytes() for answer in answers]

    def _obey(self, packet: crtp.Packet, now_s: float) -> list[crtp.Packet]:
        supervisor, port, channel = self.supervisor, packet.port, packet.channel
        match packet:
            case crtp.Packet(port=crtp.COMMANDER):
                self._take(crtp.set_point_of(packet), now_s)
            case crtp.WATCHDOG:
                supervisor.fed_s = now_s
            case crtp.EMERGENCY_STOP:
                supervisor.stops = True
            case crtp.RECOVERY:
                supervisor.crashed = self.state.crashed and self.state.tumbled
            case crtp.STATE_REQUEST:
                return [self.state.packet()]
            case crtp.VERSION_REQUEST:
                return [crtp.Packet(port, channel, bytes((0, PROTOCOL_VERSION)))]
            case crtp.Packet(port=crtp.PARAMETERS, channel=crtp.NAMED_CHANNEL):
                return [self._set_parameter(packet)]
            case _ if packet in crtp.RESTART:
                self._restart(now_s, packet)
            case _ if packet in ARMING:
                done = supervisor.request_arming(on=packet == ARMING[True])
                return [crtp.Packet(port, channel, bytes((crtp.ANSWERED | crtp.ARM, done, supervisor.armed)))]
            case _ if port == LOG and (logged := self._log.obey(packet, now_s)) is not None:
                return [logged]
            case _:
                raise FrameDecodeError(f"crazyflie: no such port or command: {port}, {channel}")
        return []

    def _set_parameter(self, packet: crtp.Packet) -> crtp.Packet:
        """Set a parameter of the LED ring by its name; others do not exist."""
        command, (group, name, setting) = packet.data[:1], (*packet.data[1:].split(b"\0", 2), b"", b"")[:3]
        error = NO_SUCH
        if group == b"ring" and name in RING:
            error = 0 if setting[:1] == bytes((RING[name],)) else INVALID
            if not error:
                self._ring[name] = setting[1:]
        if self._ring.get(b"effect") == FADE_EFFECT and len(colour := self._ring.get(b"fadeColor", b"")) == 4:
            self.light = colour[2], colour[1], colour[0]
        data = command + group + b"\0" + name + b"\0" + bytes((error,))
        return crtp.Packet(packet.port, packet.channel, data)

    def _restart(self, now_s: float, packet: crtp.Packet) -> None:
        """Restart with the second of two packets; the battery keeps its charge."""
        begun, self._restarts = self._restarts, packet == crtp.RESTART[0]
        if begun and packet == crtp.RESTART[1]:
            voltage_v, renewed = self.voltage_v, self._renewed
            self.power_cycle(now_s)
            self.voltage_v, self._renewed, self._running_s = voltage_v, renewed, now_s + BOOT_S

    def _take(self, set_point: AttitudeSetPoint, now_s: float) -> None:
        self._unlocked = self._unlocked or set_point.thrust == 0
        self._set_point, self._received_s = set_point, now_s
        pulses_us = self._settings.pulses_us(set_point, armed=self.state.armed)
        self.frames.append(SerialFrame(now_s, pulses_us, kill=self.state.locked))

    def sense(self, plant: Plant) -> None:
        """Measure the specific force on its body, by floor or change of velocity, and the voltage."""
        plant.compensated = True  # it hovers with 0.634 of its thrust at 4.1 V, and with 0.633 at 2.6 V
        if self._renewed:
            plant.renew_battery()
            self._renewed = False
        self.voltage_v = battery_voltage_v(plant.used, plant.load)
        if self.powered and plant.used >= 1.0:
            self.switch_off()
        velocity, pose = (plant.time_s, *plant.motion[4:7]), plant.pose
        elapsed_s, *change = [new - old for new, old in zip(velocity, self._sensed or velocity, strict=True)]
        self._sensed = velocity
        force_g = [gained / (elapsed_s * GRAVITY_M_S2) if elapsed_s > 0.0 else 0.0 for gained in change]
        force_g[2] += 1.0
        axis = thrust_acceleration(pose.pitch_rad, pose.roll_rad, 1.0)
        up_g = sum(force * share for force, share in zip(force_g, axis, strict=True))
        across_g = math.sqrt(max(sum(force**2 for force in force_g) - up_g**2, 0.0))
        self.supervisor.force_g = STANDING_G if plant.on_floor else (up_g, across_g)

    def advance(self, now_s: float) -> None:
        """Let the supervisor decide until `now_s`."""
        self._supervise(now_s)
        self._advanced_s = max(self._advanced_s, now_s)

    def _supervise(self, now_s: float) -> None:
        idle = LEAST_THRUST if self._arms_itself else IDLE_THRUST
        while self.powered and self._next_s <= now_s:
            step_s, self._next_s = self._next_s, self._next_s + PERIOD_S
            thrusts = self.motors_run and self._set_point.thrust > idle
            before = self.supervisor.state
            self.supervisor.step(step_s, self._received_s, thrusts=thrusts)
            if self.supervisor.state != before:
                self._note(step_s)
            if self.supervisor.blocked and (before, self.supervisor.state) == ("arming", "checks fail"):
                for part in (BLOCKED[:LONGEST_DATA], BLOCKED[LONGEST_DATA:]):
                    self._console.append(crtp.Packet(crtp.CONSOLE, 0, part))

    def _note(self, now_s: float) -> None:
        """Note what the vehicle gets if it has changed."""
        point, state = self._set_point, self.state
        self.motors_run = self.powered and state.can_fly and self._unlocked and point.thrust >= LEAST_THRUST
        if not self.motors_run:
            point = AttitudeSetPoint()
        elif self.supervisor.state == "level":
            point = AttitudeSetPoint(thrust=point.thrust)
        self.note_pulses(now_s, self._settings.pulses_us(point, armed=self.powered and state.armed))
