"""Poses for the estimators of autopilots, sent by this process: they outlive transmitter gateways."""

import math
import socket
from collections.abc import Mapping
from typing import Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rcopterx.radios.mavlink_poses import vision_pose
from rcopterx.vicon_gateway.frame import SubjectPose

SHORTEST_S: Final = 0.0195  # between two poses of a vehicle: autopilots expect 30 to 50 Hz


class PoseLink(NamedTuple):
    """Address of an autopilot's second link, an IP address and a port, and its system id."""

    address: tuple[str, int]
    system: int


class PoseSender:
    """Sends the poses of vehicles with a `PoseLink`, each with the vehicle's system id; `failed` counts."""

    def __init__(self, links: Mapping[str, PoseLink]) -> None:
        component = mavlink.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
        self._links = {
            vehicle: (link.address, mavlink.MAVLink(None, link.system, component))
            for vehicle, link in links.items()
        }
        self._sent_s = dict.fromkeys(links, -math.inf)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self.failed = 0

    def send(self, vehicle: str, subject: SubjectPose, now_s: float) -> None:
        """Send a pose that was received now, if its vehicle wants it and it is not occluded."""
        position_m, quaternion = subject.position_m, subject.quaternion_xyzw
        due = vehicle in self._links and now_s >= self._sent_s[vehicle] + SHORTEST_S
        if not due or position_m is None or quaternion is None:
            return
        self._sent_s[vehicle] = now_s
        address, mav = self._links[vehicle]
        x, y, z, w = quaternion
        roll_rad = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        nose_down_rad = math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
        yaw_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        message = vision_pose(now_s, position_m, (roll_rad, -nose_down_rad, -yaw_rad))
        try:
            self._socket.sendto(message.pack(mav), address)
        except OSError:
            self.failed += 1
        mav.seq = (mav.seq + 1) % 256

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
