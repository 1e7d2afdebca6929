"""What an autopilot reports by MAVLink (messages: mavlink.io, dialect common)."""

import math
from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rcopterx.radios.mavlink_settings import PX4, Mode
from rcopterx.radios.protocol import FrameDecodeError
from rcopterx.tables import table_beside

SETTLING_S = 0.5  # reports may be older than the answer to a command by so much
SILENT_S = 1.0
REPORTS = {  # on request: number, interval [us], and after how long one is missing [s]
    "ATTITUDE": (mavlink.MAVLINK_MSG_ID_ATTITUDE, 20_000, SILENT_S),
    "SYS_STATUS": (mavlink.MAVLINK_MSG_ID_SYS_STATUS, 1_000_000, 3.0),
}
HEARTBEAT_GONE_S = 3.0  # autopilots send a heartbeat a second
NO_VOLTAGE = 65_535
SLOW = 2.0  # times the interval that was requested, on the mean: other programs request streams, too
MEAN_SHARE = 0.1  # of each interval in that mean
CLEARED = " Cleared"  # ArduPilot withdraws a text by the same one with this word
UNEXPLAINED = "MAV_RESULT"
COMMANDS = (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE)  # that have to be obeyed
MODE_NAMES = table_beside(__file__, "mavlink_modes")
LONGEST_TEXT = 50  # of one packet; a shorter one is the last part
TEXT_S = 2.0  # a text explains what happens so long before or after it
REPEATED_S = 35.0  # ArduPilot repeats what forbids to arm every 30 s
COMPONENTS = {  # what every mode needs; a position or a remote control it may do without
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO: "gyroscope",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL: "accelerometer",
    mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS: "motors",
    mavlink.MAV_SYS_STATUS_SENSOR_BATTERY: "battery",
}


class StatusTexts:
    """Joins texts whose parts arrive in packets of their own, with an id and a number."""

    def __init__(self) -> None:
        self._id = 0
        self._parts: dict[int, str] = {}
        self._last_part: int | None = None
        self._begun_s = -math.inf

    def take(self, message: Any, now_s: float) -> str:
        """Return a text that a packet completes, or that ends unfinished with it; empty if there is none."""
        if message.id == 0:
            return str(message.text)
        unfinished = "" if message.id == self._id else self.unfinished(math.inf)
        if message.id != self._id or not self._parts:
            self._id, self._parts, self._last_part, self._begun_s = message.id, {}, None, now_s
        self._parts[message.chunk_seq] = message.text
        if len(message.text) < LONGEST_TEXT:
            self._last_part = message.chunk_seq
        if self._last_part is not None and len(self._parts) > self._last_part:
            return self.unfinished(math.inf)
        return unfinished

    def unfinished(self, now_s: float) -> str:
        """Return a text that has waited too long for its other parts, with dots for them, and forget it."""
        if not self._parts or now_s < self._begun_s + SILENT_S:
            return ""
        end = max(self._parts) if self._last_part is None else self._last_part
        parts = [self._parts.get(number, "... ") for number in range(end + 1)]
        self._parts = {}
        return "".join(parts) + ("" if self._last_part is not None else " ...")


class AutopilotState:
    """The newest reports of an autopilot.

    `armed` and `obeys`: whether it is armed, and whether its mode obeys set points; None before the first
    heartbeat. `attitude_rad` and `voltage_v`: roll to the right, pitch nose up, heading clockwise from above;
    battery. None before the first one. `complaint`: why the last command was refused; empty if it was not, or
    long ago.
    `refused_since_s`: since when it refuses to disarm, infinite if it does not.
    """

    def __init__(self, mode: Mode) -> None:
        self._mode = mode
        self.armed: bool | None = None
        self.obeys: bool | None = None
        self._reported = mode.reported
        self.attitude_rad: tuple[float, float, float] | None = None
        self.voltage_v: float | None = None
        self.complaint = ""
        self._texts, self._said = StatusTexts(), deque[tuple[float, str]](maxlen=4)
        self._mode_reason, self._mode_s, self._refused_s = "", -math.inf, -math.inf
        self.refused_since_s = math.inf
        self._refuses_to_arm, self._failing, self._passed_s = False, "", -math.inf
        self._autopilot = mode.autopilot
        self._claimed_s = self._heartbeat_s = -math.inf
        self._seen_s = dict.fromkeys(REPORTS, -math.inf)
        self._interval_s = {report: 1e-6 * interval_us for report, (_, interval_us, _) in REPORTS.items()}

    def resume(self, now_s: float) -> None:
        """Assume that it flies and obeys, as if it had just reported it."""
        self.armed = self.obeys = True
        self._heartbeat_s = self._seen_s["ATTITUDE"] = now_s

    def take(self, message: Any, now_s: float) -> None:
        """Keep a report of the autopilot; raises `FrameDecodeError` for a number that is not finite."""
        self.complaint = self.complaint if now_s <= self._refused_s + REPEATED_S else ""
        match message.get_type():
            case "HEARTBEAT":
                self._autopilot, self._heartbeat_s = message.autopilot, now_s
                if now_s >= self._claimed_s + SETTLING_S:
                    self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                    self.obeys = message.custom_mode == self._mode.reported
                    if message.custom_mode != self._reported:
                        self._mode_reason, self._mode_s = self._said_since(now_s - TEXT_S), now_s
                    self._reported = message.custom_mode
            case "ATTITUDE":
                attitude_rad = (message.roll, message.pitch, message.yaw)
                if not all(map(math.isfinite, attitude_rad)):
                    raise FrameDecodeError("mavlink: an attitude that is not finite")
                self.attitude_rad = attitude_rad
                self._note_arrival("ATTITUDE", now_s)
            case "SYS_STATUS":
                self._note_arrival("SYS_STATUS", now_s)
                self._judge_health(message, now_s)
                reported = message.voltage_battery != NO_VOLTAGE
                self.voltage_v = 0.001 * message.voltage_battery if reported else None
            case "STATUSTEXT" if message.severity <= mavlink.MAV_SEVERITY_WARNING:
                if text := self._texts.take(message, now_s):
                    self._explain(text, now_s)

    def _explain(self, text: str, now_s: float) -> None:
        """Keep a warning, which may belong to what happens soon or has just happened."""
        text = " ".join("".join(one if one.isprintable() else " " for one in text).split())
        if text.endswith(CLEARED):
            withdrawn = text.removesuffix(CLEARED)
            kept = [one for one in self._said if one[1] != withdrawn]
            self._said.clear()
            self._said.extend(kept)
            return
        self._said.append((now_s, text))
        if self.complaint.startswith(UNEXPLAINED) and now_s <= self._refused_s + TEXT_S:
            self.complaint = text
        if now_s <= self._mode_s + TEXT_S:
            self._mode_reason = self._said_since(self._mode_s - TEXT_S)

    def _said_since(self, since_s: float) -> str:
        return "; ".join(dict.fromkeys(text for said_s, text in self._said if said_s >= since_s))

    def take_answer(self, message: Any, *, arming: bool, now_s: float) -> None:
        """Keep the answer to a command: its change or refusal; `arming` if the last one was to arm."""
        if message.command not in COMMANDS:
            return
        if message.result == mavlink.MAV_RESULT_ACCEPTED:
            self.complaint, self._claimed_s, self.refused_since_s = "", now_s, math.inf
            if message.command == mavlink.MAV_CMD_DO_SET_MODE:
                self.obeys = True
            else:
                self.armed = arming
        elif message.result != mavlink.MAV_RESULT_IN_PROGRESS:
            text = self._said_since(now_s - TEXT_S) or self._texts.unfinished(now_s)
            self.complaint, self._refused_s = text or f"{UNEXPLAINED} {message.result}", now_s
            self._said.clear()
            if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and not arming:
                self.refused_since_s = min(self.refused_since_s, now_s)

    def _judge_health(self, message: Any, now_s: float) -> None:
        """Note the result of the checks before arming."""
        # ArduPilot says whether they are enabled. PX4 does not, and reports those of its present mode: in
        # another one than that of set points they count if what every mode needs is unhealthy.
        bit, health = mavlink.MAV_SYS_STATUS_PREARM_CHECK, message.onboard_control_sensors_health
        unhealthy = message.onboard_control_sensors_enabled & ~health
        self._failing = " and ".join(name for sensor, name in COMPONENTS.items() if unhealthy & sensor)
        judged = self.obeys or self._failing if self._autopilot == PX4 else unhealthy & bit
        self._refuses_to_arm = bool(judged) and not health & bit
        self._passed_s = now_s if health & bit else self._passed_s

    def arming_problem(self, now_s: float) -> str | None:
        """Why it would refuse to arm by its own checks; None if it would not."""
        if not self.sees("SYS_STATUS", now_s):
            return "no SYS_STATUS from the autopilot, which has the result of its checks"
        if not self._refuses_to_arm:
            return None
        # PX4 does not repeat a cause.
        newest_s = -math.inf if self._autopilot == PX4 else now_s - REPEATED_S
        reason = self._said_since(max(newest_s, self._passed_s)) or self.complaint
        return f"the autopilot would refuse to arm: {reason or self._failing or 'its own checks fail'}"

    @property
    def other_mode(self) -> str:
        """Mode that a pilot or a failsafe has chosen, with the warnings around the change."""
        names = MODE_NAMES.get(str(self._autopilot), {})
        name = names.get(str(self._reported), "of a pilot or a failsafe")
        return f"mode {name} ({self._reported})" + (f": {self._mode_reason}" if self._mode_reason else "")

    def _note_arrival(self, report: str, now_s: float) -> None:
        if self.sees(report, now_s):
            elapsed_s = now_s - self._seen_s[report]
            self._interval_s[report] += MEAN_SHARE * (elapsed_s - self._interval_s[report])
        self._seen_s[report] = now_s

    def wants(self, report: str, now_s: float) -> bool:
        """Whether one of `REPORTS` has to be requested: it is missing, or less frequent than requested."""
        slow = self._interval_s[report] > SLOW * 1e-6 * REPORTS[report][1]
        return slow or not self.sees(report, now_s)

    def sees(self, report: str, now_s: float) -> bool:
        """Whether one of `REPORTS` arrives."""
        return now_s - self._seen_s[report] <= REPORTS[report][2]

    def problem(self, now_s: float) -> str | None:
        """Why it cannot be flown, apart from its mode; None if it can."""
        if self._heartbeat_s == -math.inf:
            return "no heartbeat from the autopilot yet; check its power, address and system id"
        silent_s = now_s - self._heartbeat_s
        if silent_s > HEARTBEAT_GONE_S:
            return f"vehicle gone: no heartbeat for {silent_s:.1f} s"
        if not self.sees("ATTITUDE", now_s):
            return "no attitude from the autopilot"
        if self._autopilot != self._mode.autopilot:
            return "the autopilot does not have the mode of transmitter.settings"
        return None
