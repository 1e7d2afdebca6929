"""Show the positions of simulated autopilots as a Tracker does.

python autopilot_tracker.py quad1=udpin:127.0.0.1:14550 quad2=udpin:127.0.0.1:14551
"""

import argparse
import math
import time
from collections.abc import Callable

from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink
from pymavlink.quaternion import QuaternionBase

from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_frame import TrackedBody, TrackerFrame

RATE_HZ = 50.0
REQUEST_S = 1.0
NEEDED = (mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED)


class Autopilot:
    """An autopilot whose own estimate is the pose of a subject: `SUBJECT=LINK`, as pymavlink writes links."""

    def __init__(self, text: str) -> None:
        self._subject, _, link = text.partition("=")
        self._link = mavutil.mavlink_connection(link, source_system=254)
        self._requested_s = -math.inf

    def body(self, now_s: float) -> TrackedBody:
        """Newest pose; occluded before the first one."""
        while self._link.recv_msg() is not None:
            pass
        newest = self._link.messages
        if now_s > self._requested_s + REQUEST_S and self._link.target_system:
            self._requested_s = now_s
            for number in NEEDED:
                command, interval_us = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 1e6 / RATE_HZ
                words = (number, interval_us, 0, 0, 0, 0, 0)
                self._link.mav.command_long_send(self._link.target_system, 1, command, 0, *words)
        if "ATTITUDE" not in newest or "LOCAL_POSITION_NED" not in newest:
            return TrackedBody(self._subject, (0.0, 0.0, 0.0), occluded=True)
        place, angles = newest["LOCAL_POSITION_NED"], newest["ATTITUDE"]
        # z points down there, and y to the right.
        w, x, y, z = QuaternionBase([angles.roll, -angles.pitch, -angles.yaw]).q
        return TrackedBody(self._subject, (place.x, -place.y, -place.z), (x, y, z, w))


def show(autopilots: list[Autopilot], port: int, ended: Callable[[], bool] = lambda: False) -> None:
    """Serve a Tracker at a local port."""
    tracker = TrackerServer("127.0.0.1", port, rate_hz=RATE_HZ)
    start_s, frame = time.monotonic(), 0
    while not ended():
        now_s = time.monotonic()
        tracker.poll()
        tracker.publish(TrackerFrame(frame, tuple(autopilot.body(now_s) for autopilot in autopilots)))
        frame += 1
        time.sleep(max(start_s + frame / RATE_HZ - time.monotonic(), 0.0))
    tracker.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("autopilots", nargs="+", type=Autopilot, metavar="SUBJECT=LINK")
    parser.add_argument("--port", type=int, default=18801)
    arguments = parser.parse_args()
    show(arguments.autopilots, arguments.port)
