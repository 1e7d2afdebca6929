"""The MAVLink driver in virtual time, and an autopilot at the other end; pymavlink is the peer."""

from collections.abc import Mapping
from typing import Any

from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.quaternion import QuaternionBase

from rcopterx.radios.mavlink import MavlinkProtocol
from rcopterx.radios.mavlink_settings import MavlinkSettings
from rcopterx.radios.protocol import FrameFlags

DISARMED, ARMED = 1100.0, 1900.0
HOVER = (1500.0, 1500.0, 1500.0, 1500.0, ARMED)
IDLE = (1100.0, 1500.0, 1500.0, 1500.0, ARMED)
LOW = (1100.0, 1500.0, 1500.0, 1500.0, DISARMED)
KILL = FrameFlags(kill=True)
PX4, ARDUPILOT = mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
OFFBOARD, GUIDED, GUIDED_NOGPS = 6, 4, 20
ARM, MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
PARAMETERS = {
    "GUID_OPTIONS": 8.0, "GUID_TIMEOUT": 0.5, "FS_GCS_ENABLE": 5.0, "MAV_GCS_SYSID": 255.0,
    "SYSID_MYGCS": 255.0, "ATC_ANGLE_MAX": 35.0, "ANGLE_MAX": 3500.0, "COM_OF_LOSS_T": 0.5,
    "MC_YAWRATE_MAX": 200.0,
}  # fmt: skip
pulses = st.floats(1100.0, 1900.0)


class Peer:
    """A driver in virtual time, and the autopilot at the other end, whose reports a test writes."""

    def __init__(
        self,
        yaw_rad: float = 0.0,
        dialect: Any = mavlink,
        parameters: Mapping[str, float] = PARAMETERS,
        **settings: Any,
    ) -> None:
        self.protocol = MavlinkProtocol(MavlinkSettings(**settings))
        self.now_s = 0.0
        self.dialect = dialect
        self.link = dialect.MAVLink(None, srcSystem=self.protocol.settings.system, srcComponent=1)
        self.protocol.link_opened(0.0)
        for name, value in parameters.items():
            self.report(self.link.param_value_encode(name.encode(), value, 9, len(parameters), 0))
        if yaw_rad is not None:
            self.attitude(yaw_rad)
            self.summary(65535)

    def report(self, message: Any) -> None:
        self.protocol.receive(message.pack(self.link), self.now_s)
        self.link.seq = (self.link.seq + 1) % 256

    def attitude(self, yaw_rad: float) -> None:
        self.report(self.link.attitude_encode(0, 0.0, 0.0, yaw_rad, 0.0, 0.0, 0.0))

    def heartbeat(self, *, armed: bool = False, mode: int = 0, autopilot: int = PX4) -> None:
        flags = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        self.report(self.link.heartbeat_encode(mavlink.MAV_TYPE_QUADROTOR, autopilot, flags, mode, 0))

    def summary(self, voltage_mv: int = 16_000, enabled: int = 0, health: int = 0) -> None:
        words = (0, enabled, health, 0, voltage_mv, -1, -1, 0, 0, 0, 0, 0, 0)
        self.report(self.link.sys_status_encode(*words))

    def answer(self, command: int, result: int = mavlink.MAV_RESULT_ACCEPTED) -> None:
        self.report(self.link.command_ack_encode(command, result))

    def frame(self, channels: tuple[float, ...], flags: FrameFlags = FrameFlags()) -> list[Any]:  # noqa: B008
        """Messages of the next frame, 25 ms later."""
        frame = self.protocol.encode(channels, flags)
        self.now_s += 0.025
        self.protocol.frame_written(self.now_s)
        return mavlink.MAVLink(None).parse_buffer(frame) or []

    def commands(self, channels: tuple[float, ...], frames: int = 11) -> list[tuple[int, ...]]:
        """Commands of the frames of 0.25 s with their first words."""
        return [
            (each.command, each.param1, each.param2)
            for _ in range(frames)
            for each in self.frame(channels)
            if each.get_type() == "COMMAND_LONG" and each.command != mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        ]

    def set_point(self, channels: tuple[float, ...]) -> tuple[Any, list[float]]:
        """Set point of the next frame with its roll, pitch and yaw."""
        [point] = [each for each in self.frame(channels) if each.get_type() == "SET_ATTITUDE_TARGET"]
        return point, list(QuaternionBase(point.q).euler)

    @property
    def text(self) -> str:
        return self.protocol.status(self.now_s).text

    @property
    def ready(self) -> bool:
        return self.protocol.status(self.now_s).ready
