"""Settings of the radio protocol `mavlink`, which need no library."""

from dataclasses import dataclass
from typing import NamedTuple

from rcopterx.radios.protocol import ProtocolError, SerialLine, check_choice, check_ranges
from rcopterx.radios.set_points import FullStick
from rcopterx.radios.udp import udp_address
from rcopterx.user_text import ip_version


class Mode(NamedTuple):
    """A mode of a `MAV_AUTOPILOT` that obeys set points, as requested, as reported, bits for no rates."""

    autopilot: int
    requested: int
    reported: int
    ignored: int


PX4, ARDUPILOT = 12, 3
MODES = {
    "offboard": Mode(PX4, 6, 6 << 16, 0b011),
    # ArduPilot wants all body rates, or none.
    "guided_nogps": Mode(ARDUPILOT, 20, 20, 0),
    "guided": Mode(ARDUPILOT, 4, 4, 0),
}
LINE = SerialLine(921_600)
MISSING_LIBRARY = "the library pymavlink is not installed: pip install 'rcopterx[mavlink]'"


@dataclass(frozen=True, slots=True)
class MavlinkSettings(FullStick):
    """How channels become set points of PX4 and ArduPilot."""

    system: int = 1
    """System id of the vehicle: `MAV_SYS_ID` of PX4, `MAV_SYSID` of ArduPilot."""
    own_system: int = 255
    """System id of the gateway, which counts as the ground station of the vehicle."""
    baud: int = LINE.baud
    """Speed of a serial line [1/s]."""
    local_port: int = 0
    """UDP port that the gateway sends from, 0 for any. PX4 answers the port that it got its first datagram
    from until it restarts, also after a restart of the gateway."""
    mode: str = "offboard"
    """Mode that obeys set points: `offboard` of PX4; `guided_nogps` of ArduPilot, or `guided`, which needs a
    position."""
    external_pose: bool = False
    """Send the poses of motion capture as well, for its estimator: 130 bytes in each frame. They end with the
    transmitter gateway; `pose_port` does not."""
    pose_port: str = ""
    """`udp://ADDRESS:PORT` of a further link of the autopilot, which the Vicon gateway sends the poses to."""
    flight_termination: bool = False
    """With a kill also request flight termination, which PX4 keeps until it restarts."""

    def __post_init__(self) -> None:
        # A class with slots is made anew, so that super() without arguments would not find it.
        FullStick.__post_init__(self)
        check_ranges(self, "mavlink", system=(1, 255), own_system=(1, 255))
        check_ranges(self, "mavlink", baud=(57_600, 3_000_000), local_port=(0, 65_535))
        check_choice("mavlink.mode", self.mode, MODES)
        if self.pose_port:
            self._check_pose_port()
        if self.system == self.own_system:
            raise ProtocolError(f"mavlink.own_system: {self.own_system} is the vehicle's, choose another one")

    def _check_pose_port(self) -> None:
        """Raise `ProtocolError` if poses cannot be sent there; the Vicon gateway looks no names up."""
        host, _ = udp_address(self.pose_port)
        if ip_version(host) != 4:
            raise ProtocolError(f"mavlink.pose_port: {host!r} is no IP address of version 4")
        if self.external_pose:
            raise ProtocolError("mavlink.pose_port: leave external_pose out, poses are sent once")
