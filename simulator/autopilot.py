"""Emulated autopilot between MAVLink and motors.

Behaviour: documentation of PX4; landing detectors and answers as PX4 1.16.1 (`sihsim_quadx`) and ArduCopter
4.8-dev (1b34668c) showed them in their own simulations; what they do without a position: their sources
(`ekf_check.cpp`, `AP_NavEKF3.h`, `AP_Arming.cpp`; `mode_requirements.cpp`).
"""

import math
from collections import Counter, deque
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rcopterx.radios.mavlink import FORCE, packed, set_point_of
from rcopterx.radios.mavlink_settings import ARDUPILOT, MODES, PX4, MavlinkSettings
from rcopterx.radios.mavlink_state import COMMANDS, LONGEST_TEXT
from rcopterx.radios.protocol import FrameDecodeError
from rcopterx.radios.set_points import AttitudeSetPoint
from rcopterx.simulator.autopilot_heading import HeadingControl, body_of
from rcopterx.simulator.plant import Plant
from rcopterx.simulator.radio_module import FRAME_LOG_LENGTH, SerialFrame
from rcopterx.simulator.vehicle_udp import UdpVehicle
from rcopterx.vehicles.model import Model

LOITER, LAND = 4 << 16 | 3 << 24, 4 << 16 | 6 << 24  # modes of PX4 as reported
HOLDING: Final = {PX4: LOITER, ARDUPILOT: 0}  # `INITIAL_MODE`
LANDING: Final = {PX4: LAND, ARDUPILOT: 9}
SLOWEST_STREAM_S: Final = 0.5
STREAM_BEFORE_S: Final = 1.0
LOSS_S: Final = 1.0  # `COM_OF_LOSS_T`
GCS_LOSS_S: Final = 2.0  # `FS_GCS_TIMEOUT`; until then ArduCopter hovers level
PAUSE_S: Final = 4.0  # `LAND_WITH_DELAY_MS` of a landing by a failsafe
WAITS_S: Final = {PX4: (0.0, math.inf), ARDUPILOT: (4.0, 30.0)}  # to a text about a new cause, or an old one
FIRST_WAITED_S: Final = 3.0  # of the time to a new text, at the start: chosen
POSITION_S: Final = {PX4: 5.0, ARDUPILOT: 7.0}  # without poses: `EKF2_NOAID_TOUT`, `posRetryTimeNoVel_ms`
EKF_CHECK_S: Final = 1.0  # `EKF_CHECK_ITERATIONS_MAX`: from a lost position to the failsafe of ArduCopter
BATTERY_LOW: Final = "Arm: Battery 1 below minimum arming voltage"
DENIED: Final = "Arming denied: Resolve system health failures first\t"
CRITICAL: Final = "Critical battery\t"  # PX4 says a cause once, when it begins
NEEDS_POSITION: Final = 4  # GUIDED; attitude set points of PX4 need none
CONSISTENT_S: Final = 20.0  # from its start, until ArduCopter finds its inertial sensors consistent
HOVER_SHARE: Final = 0.02  # of each set point in the thrust that it learns to hover with
SINKING: Final = 0.95  # share of that thrust in a landing
FLYING_M: Final = 0.02
LANDED_S: Final = 2.5  # on the floor with low throttle, until PX4 detects the landing
NORTH_RAD: Final = 1.0  # heading of the x axis of the laboratory: north is zero for an autopilot
FULL_V: Final = 16.8
EMPTY_V: Final = 14.0
ENDURANCE_S: Final = 600.0
PERIODS_S: Final = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 0.1,
}
"""Of its reports, before other ones are requested."""
STREAMS: Final = {
    mavlink.MAV_DATA_STREAM_ALL: {mavlink.MAVLINK_MSG_ID_SYS_STATUS, mavlink.MAVLINK_MSG_ID_ATTITUDE},
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: {mavlink.MAVLINK_MSG_ID_SYS_STATUS},
    mavlink.MAV_DATA_STREAM_EXTRA1: {mavlink.MAVLINK_MSG_ID_ATTITUDE},
}
"""Reports of the streams that ground stations request of ArduPilot, whose rates replace those of reports."""


class EmulatedAutopilot(UdpVehicle):
    """The firmware of one quadrotor: it obeys set points in the mode of its settings and lands when they end.

    `armed` and `mode`: as its heartbeat reports them. `terminated`: whether its flight was terminated, which
    only a restart ends. `rejected`: packets that it ignored, by reason. `settings`: how set points become the
    pulse widths that the simulated vehicle gets, and its system id. `parameters` that it has;
    others it does not answer. `flown_s`: time armed with this battery. `hangs`: whether it reports, but
    answers neither arming nor modes: PX4 with a dangerously low battery until it switches itself off.
    """

    def __init__(self, settings: MavlinkSettings, start_s: float = 0.0) -> None:
        super().__init__(deque(maxlen=FRAME_LOG_LENGTH))
        self._settings = settings
        self._obeying = MODES[settings.mode]
        self._ardupilot = self._obeying.autopilot == ARDUPILOT
        self.rejected: Counter[str] = Counter()
        self.parameters = {
            "GUID_OPTIONS": 8.0, "GUID_TIMEOUT": 0.5, "FS_GCS_ENABLE": 5.0,
            "MAV_GCS_SYSID": float(settings.own_system), "ATC_ANGLE_MAX": settings.full_tilt_deg,
            "BATT_FS_LOW_ACT": 0.0, "NTF_LED_OVERRIDE": 1.0,
        } if self._ardupilot else {
            "COM_OF_LOSS_T": LOSS_S, "MC_YAWRATE_MAX": settings.full_yaw_rate_deg_s,
        }  # fmt: skip
        self._height_m, self._attitude_rad = 0.0, (0.0, 0.0, NORTH_RAD)
        self._heading = HeadingControl(self._obeying.autopilot, math.radians(settings.full_yaw_rate_deg_s))
        self.power_cycle(start_s)

    def power_cycle(self, now_s: float) -> None:
        """Start anew with a full battery, disarmed."""
        self._mav = mavlink.MAVLink(None, self._settings.system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._mav.robust_parsing = True
        self.powered, self.armed, self.terminated, self.hangs = True, False, False, False
        self.mode = HOLDING[self._obeying.autopilot]
        self._periods_s, self._due_s = dict(PERIODS_S), dict.fromkeys(PERIODS_S, now_s)
        self.flown_s, self._booted_s, self._failed_s, self._posed_s = 0.0, now_s, -math.inf, -math.inf
        self._complained_s, self._refused, self._news = now_s - FIRST_WAITED_S, False, False
        self._strays = True  # whether it has acted on a missing position; never before it has had one
        self._said: list[Any] = []
        self._streams_since_s, self._received_s, self._advanced_s = now_s, -math.inf, now_s
        self._set_point, self._heading_rad, self._hover = AttitudeSetPoint(), 0.0, 0.5
        self._landed_s: float | None = -math.inf  # since when it stands with low throttle; None in flight

    def switch_off(self) -> None:
        """Remove the battery."""
        self.powered = self.armed = False
        self._note(self._advanced_s)

    def body_of(self, model: Model) -> Model:
        """See `Reception`."""
        full = self._settings
        tilt_rad, rate_rad_s = math.radians(full.full_tilt_deg), math.radians(full.full_yaw_rate_deg_s)
        return body_of(model, self._obeying.autopilot, tilt_rad, rate_rad_s)

    def sense(self, plant: Plant) -> None:
        """Measure the pose of its body."""
        pose = plant.pose
        self._height_m = pose.position_m[2]
        # z points down here, and y to the right.
        yaw_rad = math.remainder(NORTH_RAD - pose.yaw_rad, math.tau)
        self._attitude_rad = pose.roll_rad, -pose.pitch_rad, yaw_rad

    # Messages -----------------------------------------------------------------------------------------

    def receive(self, raw: bytes, now_s: float) -> list[bytes]:
        """Obey the packets of a datagram; return the answers."""
        self.advance(now_s)
        answers: list[bytes] = []
        for packet in (self._mav.parse_buffer(raw) or ()) if self.powered else ():
            try:
                answers += self._obey(packet, now_s)
            except FrameDecodeError as error:
                self.rejected[str(error)] += 1
        self._note(now_s)
        return answers

    def _obey(self, packet: Any, now_s: float) -> list[bytes]:
        kind = packet.get_type()
        if kind == "BAD_DATA":
            raise FrameDecodeError("mavlink: malformed")
        if getattr(packet, "target_system", 0) not in (0, self._settings.system):
            raise FrameDecodeError("mavlink: for another system")
        if kind == "SET_ATTITUDE_TARGET":
            self._take(packet, now_s)
        if kind == "VISION_POSITION_ESTIMATE":
            self._posed_s, self._strays = now_s, False
        if kind == "LED_CONTROL" and self.parameters.get("NTF_LED_OVERRIDE") and packet.custom_len == 3:
            self.light = tuple(packet.custom_bytes[:3])
        if kind == "REQUEST_DATA_STREAM" and self._ardupilot and packet.req_message_rate > 0:
            for number in STREAMS.get(packet.req_stream_id, ()):
                self._periods_s[number], self._due_s[number] = 1.0 / packet.req_message_rate, now_s
        if kind == "PARAM_REQUEST_READ" and packet.param_id in self.parameters:
            value, number = self.parameters[packet.param_id], len(self.parameters)
            name, real = packet.param_id.encode(), mavlink.MAV_PARAM_TYPE_REAL32
            return [packed(self._mav, mavlink.MAVLink_param_value_message(name, value, real, number, 0))]
        if kind != "COMMAND_LONG" or (self.hangs and packet.command in COMMANDS):
            return []
        result, refusal = self._command(packet, now_s)
        sender = packet.get_srcSystem(), packet.get_srcComponent()
        answer = mavlink.MAVLink_command_ack_message(packet.command, result, 0, 0, *sender)
        return [packed(self._mav, message) for message in (*_texts(refusal), answer)]

    def _take(self, packet: Any, now_s: float) -> None:
        point, heading_rad = set_point_of(packet)
        if now_s > self._received_s + SLOWEST_STREAM_S:
            self._streams_since_s = now_s
        self._set_point, self._heading_rad, self._received_s = point, heading_rad, now_s
        if self._height_m > FLYING_M:
            self._hover += HOVER_SHARE * (point.thrust - self._hover)
        pulses_us = self._settings.pulses_us(point, armed=self.armed)
        self.frames.append(SerialFrame(now_s, pulses_us, kill=self.terminated))

    def _command(self, packet: Any, now_s: float) -> tuple[int, str]:
        """Obey a command; return the result, and why it was refused."""
        refusal, first = "", packet.param1
        match packet.command:
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                refusal = self._arm(on=first > 0.5, force=packet.param2 == FORCE)
            case mavlink.MAV_CMD_DO_SET_MODE:
                if not (math.isfinite(packet.param2) and math.isfinite(packet.param3)):
                    raise FrameDecodeError("mavlink: a mode that is not finite")
                refusal = self._change_mode(round(packet.param2), round(packet.param3))
            case mavlink.MAV_CMD_DO_FLIGHTTERMINATION if first > 0.5:
                self.terminated, self.armed = True, False
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL if first in self._periods_s and packet.param2 > 0:
                self._periods_s[round(first)], self._due_s[round(first)] = 1e-6 * packet.param2, now_s
            case _:
                return mavlink.MAV_RESULT_UNSUPPORTED, ""
        refused = mavlink.MAV_RESULT_FAILED if self._ardupilot else mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        return (refused if refusal else mavlink.MAV_RESULT_ACCEPTED), refusal

    @property
    def _landed(self) -> bool:
        """Whether it detects its landing; ArduPilot in a mode that obeys thrusts misses one it has flown."""
        since_s = self._landed_s
        if self._ardupilot and self._obeys:
            return since_s == -math.inf
        return since_s is not None and self._advanced_s >= since_s + LANDED_S

    @property
    def _obeys(self) -> bool:
        return self.mode == self._obeying.reported

    @property
    def _streams(self) -> bool:
        """Whether set points have come fast enough for long enough."""
        lasting = self._advanced_s >= self._streams_since_s + STREAM_BEFORE_S
        return lasting and self._advanced_s <= self._received_s + SLOWEST_STREAM_S

    def _arm(self, *, on: bool, force: bool) -> str:
        """Arm or disarm; return why not."""
        if on and (refusal := self._check()):
            return refusal
        if on and self._set_point.thrust > 0:
            return "Arming denied: thrust is not zero"
        if not on and not force and not self._landed:
            return "Disarming denied: not landed"
        self.armed, self._landed_s = on, -math.inf
        return ""

    def _check(self) -> str:
        """Return why the checks before arming fail in the present mode."""
        if self.terminated:
            return "Arming denied: flight terminated, restart it"
        if self.flown_s >= ENDURANCE_S:
            return BATTERY_LOW if self._ardupilot else DENIED
        if self._ardupilot and self._advanced_s < self._booted_s + CONSISTENT_S:
            return "Arm: Accels inconsistent"
        if self.mode == NEEDS_POSITION and not self._located:
            return "Arm: Need Position Estimate"
        if self._obeys:
            return "" if self._streams else "Arming denied: no offboard signal"
        # Other modes of PX4 need a position; that of ArduPilot after its start does not.
        return "" if self._ardupilot or self._located else DENIED

    def _change_mode(self, main: int, sub: int) -> str:
        """Change the mode; return why not."""
        obeying = main == self._obeying.requested
        other = main if self._ardupilot else main << 16 | sub << 24
        mode, autopilot = self._obeying.reported if obeying else other, self._obeying.autopilot
        allowed = (HOLDING[autopilot], LANDING[autopilot], self._obeying.reported)
        if mode not in allowed or (obeying and not self._streams):
            return "This mode is currently not available"
        self.mode = mode
        return ""

    def reports(self, now_s: float) -> list[bytes]:
        """Return the reports that are due."""
        if not self.powered:
            return []
        due = [number for number, due_s in self._due_s.items() if now_s >= due_s]
        for number in due:
            self._due_s[number] = max(self._due_s[number] + self._periods_s[number], now_s)
        if not (self._ardupilot and self.armed):
            self._complain(now_s)
        messages, self._said = [*map(self._report, due), *self._said], []
        return [packed(self._mav, message) for message in messages]

    def _complain(self, now_s: float) -> None:
        """Say what the checks before arming find: PX4 once, and only of its battery."""
        refusal = self._check() if self._ardupilot else CRITICAL * (self.flown_s >= ENDURANCE_S)
        self._news = self._news or (bool(refusal) and not self._refused)
        self._refused = bool(refusal)
        if refusal and now_s >= self._complained_s + WAITS_S[self._obeying.autopilot][not self._news]:
            self._complained_s, self._news = now_s, False
            self._said += _texts(refusal.replace("Arm:", "PreArm:"))

    def _report(self, number: int) -> Any:
        if number == mavlink.MAVLINK_MSG_ID_ATTITUDE:
            return mavlink.MAVLink_attitude_message(
                round(1000 * self._advanced_s) % 2**32, *self._attitude_rad, 0.0, 0.0, 0.0
            )
        if number == mavlink.MAVLINK_MSG_ID_SYS_STATUS:
            share = max(1.0 - self.flown_s / ENDURANCE_S, 0.0)
            voltage_mv = round(1000 * (EMPTY_V + (FULL_V - EMPTY_V) * share))
            bit, battery = mavlink.MAV_SYS_STATUS_PREARM_CHECK, mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
            enabled = battery | bit * self._ardupilot
            healthy = bit * (not self._check()) | battery * (share > 0)
            return mavlink.MAVLink_sys_status_message(
                enabled, enabled, healthy, 0, voltage_mv, -1, round(100 * share), 0, 0, 0, 0, 0, 0
            )
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_SAFETY_ARMED * self.armed
        state = mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY
        kind, autopilot = mavlink.MAV_TYPE_QUADROTOR, self._obeying.autopilot
        return mavlink.MAVLink_heartbeat_message(kind, autopilot, flags, self.mode, state, 3)

    # Motors -------------------------------------------------------------------------------------------

    def advance(self, now_s: float) -> None:
        """Apply the age of set points until `now_s`, and control the heading."""
        elapsed_s = max(now_s - self._advanced_s, 0.0)
        self.flown_s += self.armed * elapsed_s
        if self.armed and self._obeys and self._height_m > FLYING_M:
            rate_rad_s = math.radians(self._set_point.yaw_rate_deg_s)
            self._heading.advance(self._heading_rad, rate_rad_s, elapsed_s)
        else:
            self._heading.rest(self._attitude_rad[2])
        self._advanced_s = max(self._advanced_s, now_s)
        if self._height_m > FLYING_M:
            self._landed_s = None
        elif self._landed_s is None and self._wanted().thrust == 0:
            self._landed_s = now_s
        lost_s = GCS_LOSS_S if self._ardupilot else LOSS_S
        if self._obeys and now_s > self._received_s + lost_s:
            self.mode, self._failed_s = (LANDING if self.armed else HOLDING)[self._obeying.autopilot], now_s
        strays_s = self._posed_s + POSITION_S[ARDUPILOT] + EKF_CHECK_S
        if self._ardupilot and not self._strays and now_s > strays_s:
            self._stray(now_s)
        fails = self.armed and self.flown_s >= ENDURANCE_S and not self._lands
        if fails and self.parameters.get("BATT_FS_LOW_ACT"):
            self.mode, self._failed_s = LANDING[ARDUPILOT], now_s
            self._said += _texts("Battery Failsafe")
        if self._lands and self._height_m <= FLYING_M:
            self.armed = False
        self._note(now_s)

    @property
    def _located(self) -> bool:
        """Whether it has a position: by poses once any arrived, before by a link that is not emulated."""
        if not self._settings.external_pose and self._posed_s == -math.inf:
            return self._ardupilot or bool(self._settings.pose_port)
        return self._advanced_s <= self._posed_s + POSITION_S[self._obeying.autopilot]

    def _stray(self, now_s: float) -> None:
        """Act on a position that is lost: ArduCopter lands if its mode needs one."""
        self._strays, lands = True, self.armed and self.mode == NEEDS_POSITION
        if lands:
            self.mode, self._failed_s = LANDING[ARDUPILOT], now_s
        self._said += _texts("EKF variance: position lost")
        if self.armed:
            self._said += _texts("EKF Failsafe: changed to Land Mode" if lands else "EKF Failsafe")

    def _note(self, now_s: float) -> None:
        """Note what the vehicle gets if it has changed."""
        self.note_pulses(now_s, self._settings.pulses_us(self._wanted(), armed=self.armed))

    @property
    def _lands(self) -> bool:
        return self.mode == LANDING[self._obeying.autopilot]

    def _wanted(self) -> AttitudeSetPoint:
        point = self._set_point
        if self.armed and self._obeys:
            timeout_s = self.parameters.get("GUID_TIMEOUT", math.inf)
            if point.thrust and self._advanced_s > self._received_s + timeout_s:
                return AttitudeSetPoint(thrust=self._hover)
            yaw_rate = math.degrees(self._heading.rate_rad_s(self._attitude_rad[2]))
            return AttitudeSetPoint(point.roll_deg, point.pitch_deg, yaw_rate, point.thrust)
        if not (self.armed and self._lands):
            return AttitudeSetPoint()
        pauses = self._ardupilot and self._advanced_s < self._failed_s + PAUSE_S
        return AttitudeSetPoint(thrust=self._hover * (1.0 if pauses else SINKING))


def _texts(words: str) -> list[Any]:
    """Return the messages of a text; none for an empty one."""
    text = words.encode()
    parts = [text[start : start + LONGEST_TEXT] for start in range(0, len(text), LONGEST_TEXT)]
    severity, several = mavlink.MAV_SEVERITY_CRITICAL, int(len(parts) > 1)
    return [
        mavlink.MAVLink_statustext_message(severity, part, several, number)
        for number, part in enumerate(parts)
    ]
