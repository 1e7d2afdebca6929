"""Vehicles with PX4 or ArduPilot: attitude set points, mode and arming by MAVLink 2 (mavlink.io, common)."""

import math
from dataclasses import replace
from typing import Any, ClassVar

from msgspec import structs
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.quaternion import QuaternionBase

from rcopterx.radios.mavlink_parameters import ParameterCheck
from rcopterx.radios.mavlink_poses import vision_pose
from rcopterx.radios.mavlink_settings import ARDUPILOT, LINE, MODES, MavlinkSettings
from rcopterx.radios.mavlink_state import REPORTS, SILENT_S, AutopilotState
from rcopterx.radios.protocol import FrameDecodeError, ModuleStatus, SerialLine
from rcopterx.radios.set_points import AttitudeSetPoint, SetPointRadio

HEARTBEAT_S = 0.5
REQUEST_S = 0.25  # commands are repeated so often until they are obeyed
REFUSED_S = 1.0  # from a disarming that is refused until it is forced, on the floor
FORCE = 21_196  # third word of a command to disarm: also in flight
LARGEST_LEAD_RAD = 0.5  # of the heading of set points before that of the vehicle
PACKETS_REMEMBERED = 300
LONGEST_ERROR = 1e-3  # of the length of a quaternion, as ArduPilot allows it


class MavlinkProtocol(SetPointRadio):
    """Driver of one vehicle; a frame is one or more packets, which travel in one datagram.

    A set point has a heading besides the yaw rate: it starts where the autopilot reports it, and moves
    with the rate. Before the autopilot has reported its attitude a frame has no set point.
    `counters` counts malformed packets.
    """

    name: ClassVar[str] = "mavlink"
    settings: MavlinkSettings

    def __init__(self, settings: MavlinkSettings | None = None, line: SerialLine = LINE) -> None:
        settings = settings or MavlinkSettings()
        super().__init__(settings, replace(line, baud=settings.baud), PACKETS_REMEMBERED)
        self.local_port = settings.local_port
        self._mav = mavlink.MAVLink(
            None, srcSystem=settings.own_system, srcComponent=mavlink.MAV_COMP_ID_MISSIONPLANNER
        )
        self._mav.robust_parsing = True
        self._mode = MODES[settings.mode]
        self._state = AutopilotState(self._mode)
        self._parameters = ParameterCheck(self._mode.autopilot, settings)
        self._sequence: int | None = None
        self._target = (settings.system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._now_s, self._beat_s, self._requested_s, self._arming_s = 0.0, -math.inf, -math.inf, 0.0
        self._heading_rad: float | None = None
        self._yaw_rate_rad_s = 0.0
        self._pose: tuple[float, float, float, float] | None = None
        self._armed = self._arming = self._thrusts = self._standing = False
        self._colour: tuple[int, int, int] | None = None

    # Frames -------------------------------------------------------------------------------------------

    def _set_point_frame(self, point: AttitudeSetPoint, *, armed: bool, kill: bool) -> bytes:
        """Build a frame; a kill stops the motors at once."""
        urgent = armed is not self._armed or (kill and self._state.armed is not False)
        self._arming_s = self._now_s if armed and not self._armed else self._arming_s
        self._arming = armed and (self._arming or not self._armed)
        self._armed, self._thrusts = armed, point.thrust > 0
        packets = []
        if urgent or self._now_s >= self._requested_s + REQUEST_S:
            self._requested_s = self._now_s
            packets += self._kill() if kill else self._requests()
        packets += [*self._set_point(point), *self._external_pose()]
        if self._now_s >= self._beat_s + HEARTBEAT_S or not packets:
            self._beat_s = self._now_s
            packets += [self.probe(), *self._lights()]
        return b"".join(packets)

    def probe(self) -> bytes:
        """Return a heartbeat; an autopilot answers to its sender."""
        kind, autopilot = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
        state, version = mavlink.MAV_STATE_ACTIVE, 3
        return packed(self._mav, mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, state, version))

    def _command(self, command: int, *parameters: float) -> bytes:
        values = [*parameters, *([0.0] * (7 - len(parameters)))]
        return packed(self._mav, mavlink.MAVLink_command_long_message(*self._target, command, 0, *values))

    def _set_point(self, point: AttitudeSetPoint) -> list[bytes]:
        if self._state.attitude_rad is None:
            return []
        yaw_rad = self._state.attitude_rad[2]
        heading_rad = self._heading_rad if self._thrusts else None
        lead_rad = 0.0 if heading_rad is None else math.remainder(heading_rad - yaw_rad, math.tau)
        self._heading_rad = yaw_rad + min(max(lead_rad, -LARGEST_LEAD_RAD), LARGEST_LEAD_RAD)
        self._yaw_rate_rad_s = math.radians(point.yaw_rate_deg_s)
        roll_rad, pitch_rad = math.radians(point.roll_deg), math.radians(point.pitch_deg)
        rotation = QuaternionBase([roll_rad, pitch_rad, self._heading_rad]).q
        time_ms, rates = round(1000 * self._now_s) % 2**32, (0.0, 0.0, self._yaw_rate_rad_s)
        message = mavlink.MAVLink_set_attitude_target_message(
            time_ms, *self._target, self._mode.ignored, list(rotation), *rates, point.thrust
        )
        return [packed(self._mav, message)]

    def pose_seen(self, position_m: tuple[float, float, float], yaw_rad: float, *, standing: bool) -> None:
        """See `RadioProtocol`; its roll and pitch are those that the autopilot reports."""
        self._standing = standing
        self._pose = (*position_m, yaw_rad) if self.settings.external_pose else None

    def _external_pose(self) -> list[bytes]:
        """Pack the newest pose once, with unknown covariance."""
        if self._pose is None or self._state.attitude_rad is None:
            return []
        (x, y, z, yaw_rad), self._pose = self._pose, None
        roll_rad, pitch_rad, _ = self._state.attitude_rad
        return [packed(self._mav, vision_pose(self._now_s, (x, y, z), (roll_rad, pitch_rad, -yaw_rad)))]

    def light(self, colour: tuple[int, int, int]) -> bool:
        """See `RadioProtocol`: on the LEDs of ArduPilot, if `NTF_LED_OVERRIDE` is 1; PX4 obeys no colours."""
        if self._mode.autopilot != ARDUPILOT:
            return False
        self._colour, self._beat_s = colour, -math.inf
        return True

    def _lights(self) -> list[bytes]:
        """Pack the colour, which is repeated with every heartbeat."""
        if self._colour is None:
            return []
        every, custom, unused = 255, 255, [0] * 21
        words = every, custom, len(self._colour), [*self._colour, *unused]
        return [packed(self._mav, mavlink.MAVLink_led_control_message(*self._target, *words))]

    def _kill(self) -> list[bytes]:
        packets = [self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, FORCE)]
        if self.settings.flight_termination:
            packets.append(self._command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1))
        return packets

    def _requests(self) -> list[bytes]:
        """Pack the commands that bring the vehicle into the state that is wanted, next step first."""
        # Only once a flight, without thrust: later a pilot or a failsafe chooses the mode, and disarms.
        state = self._state
        packets = []
        for report, (number, interval_us, _) in REPORTS.items():
            if state.wants(report, self._now_s):
                packets.append(self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval_us))
        if not self._armed and state.sees("ATTITUDE", self._now_s):
            for name in self._parameters.wanted():
                request = mavlink.MAVLink_param_request_read_message(*self._target, name.encode(), -1)
                packets.append(packed(self._mav, request))
        arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        if self._arming and state.armed and state.obeys:
            self._arming = False
        elif self._arming and not self._thrusts:
            custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            mode = self._command(mavlink.MAV_CMD_DO_SET_MODE, custom, self._mode.requested)
            packets.append(self._command(arm, 1) if state.obeys else mode)
        elif not self._armed and state.armed and state.obeys:
            # An autopilot that does not detect its landing refuses, and its motors go on turning.
            forced = self._standing and self._now_s >= state.refused_since_s + REFUSED_S
            packets.append(self._command(arm, 0, FORCE if forced else 0))
        return packets

    def frame_written(self, now_s: float) -> None:
        """Move the heading with the yaw rate."""
        if self._heading_rad is not None:
            self._heading_rad += self._yaw_rate_rad_s * (now_s - self._now_s)
        self._now_s = now_s

    # Answers ------------------------------------------------------------------------------------------

    def link_opened(self, now_s: float) -> None:
        """Wait for a new state."""
        super().link_opened(now_s)
        self._state = AutopilotState(self._mode)
        self._parameters = ParameterCheck(self._mode.autopilot, self.settings)
        self._sequence = self._heading_rad = None
        self._armed = self._arming = False
        self._now_s = now_s

    def link_resumed(self, now_s: float) -> None:
        """Count the vehicle as ready and armed, as if it had just reported it."""
        self.link_opened(now_s)
        self._state.resume(now_s)
        self._parameters.skip()
        self._armed = True

    def receive(self, data: bytes, now_s: float) -> None:
        """Keep the newest state of the vehicle; packets of others are ignored."""
        for packet in self._mav.parse_buffer(data) or ():
            if packet.get_type() == "BAD_DATA":
                self.counters["mavlink: malformed"] += 1
            elif packet.get_type().startswith("UNKNOWN"):
                # Of another dialect: only its header can be read.
                self._count(packet.data[5], packet.data[6], packet.data[4])
            elif self._count(packet.get_srcSystem(), packet.get_srcComponent(), packet.get_seq()):
                self._take(packet, now_s)

    def _count(self, system: int, component: int, sequence: int) -> bool:
        """Note that a packet arrived, and those before it that did not; return if it is the autopilot's."""
        if (system, component) != self._target:
            return False
        lost = 0 if self._sequence is None else (sequence - self._sequence - 1) % 256
        self._sequence = sequence
        self._answers.extend([*([False] * lost), True])
        return True

    def _take(self, packet: Any, now_s: float) -> None:
        try:
            if packet.get_type() == "COMMAND_ACK":
                if packet.target_system not in (0, self.settings.own_system):
                    return
                self._state.take_answer(packet, arming=self._armed, now_s=now_s)
            elif packet.get_type() == "PARAM_VALUE":
                self._parameters.take(packet)
            else:
                self._state.take(packet, now_s)
                if packet.get_type() == "SYS_STATUS":
                    self._report_voltage(self._state.voltage_v, now_s)
            complaint = self._state.complaint
            silent = self._arming and now_s > self._arming_s + SILENT_S
            unarmed = "; not armed: no answer" if silent else ""
            self.remark = f"; refused: {complaint}" if complaint else unarmed
        except FrameDecodeError as error:
            self.counters[str(error)] += 1

    def _problem(self, now_s: float) -> str | None:
        state = self._state
        problem = state.problem(now_s)
        if problem is not None or (self._armed and state.armed and state.obeys):
            return problem
        if self._armed and self._arming:
            return f"the autopilot did not arm: {state.complaint or 'no answer'}" if self._thrusts else None
        if self._armed:
            return state.other_mode if state.armed else "the autopilot has disarmed"
        if not state.armed:
            return self._parameters.problem or state.arming_problem(now_s)
        if not state.obeys:
            return f"armed in {state.other_mode}"
        return f"the autopilot is still armed: {state.complaint or 'it has not answered yet'}"

    def status(self, now_s: float) -> ModuleStatus:
        """See `SetPointRadio`; armed as the autopilot reports it."""
        return structs.replace(super().status(now_s), armed=self._state.armed)


def packed(mav: mavlink.MAVLink, message: Any) -> bytes:
    """Pack a message with the next sequence number of its sender."""
    packet: bytes = message.pack(mav)
    mav.seq = (mav.seq + 1) % 256
    return packet


def set_point_of(message: Any) -> tuple[AttitudeSetPoint, float]:
    """Return set point and heading, clockwise from north [rad], or raise `FrameDecodeError`."""
    if not all(map(math.isfinite, (*message.q, message.body_yaw_rate, message.thrust))):
        raise FrameDecodeError("mavlink: a set point that is not finite")
    length = math.hypot(*message.q)
    if abs(length - 1.0) > LONGEST_ERROR:
        raise FrameDecodeError("mavlink: a set point that is no rotation")
    roll_rad, pitch_rad, yaw_rad = QuaternionBase([part / length for part in message.q]).euler
    roll_deg, pitch_deg, yaw_rate_deg_s = map(math.degrees, (roll_rad, pitch_rad, message.body_yaw_rate))
    return AttitudeSetPoint(roll_deg, pitch_deg, yaw_rate_deg_s, min(max(message.thrust, 0.0), 1.0)), yaw_rad
