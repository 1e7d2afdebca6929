"""A Tracker that shows the true states of simulations."""

import argparse
import math
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_frame import TrackedBody, TrackerFrame

RATE_HZ = 50.0
REQUEST_S = 1.0
METRES_PER_DEGREE = 111_319.5


class Body(Protocol):
    """A subject of the Tracker."""

    def body(self, now_s: float) -> TrackedBody:
        """Newest pose; occluded before the first one."""


class TrueState(NamedTuple):
    """Latitude and longitude [degrees], height [m], rotation as w, x, y, z in north, east, down."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    rotation: Sequence[float]


class MavlinkTruth:
    """A simulation that sends its true state as one message of MAVLink; text `SUBJECT=LINK`.

    Links are written as pymavlink does. The Tracker's origin is where the vehicle is seen first, x points
    north, y west, z up.
    """

    def __init__(self, text: str, number: int, state_of: Callable[[Any], TrueState]) -> None:
        self._subject, _, link = text.partition("=")
        self._link = mavutil.mavlink_connection(link, source_system=254)
        self._number, self._state_of = number, state_of
        self._name = mavlink.mavlink_map[number].msgname
        self._requested_s, self._origin = -math.inf, None

    def body(self, now_s: float) -> TrackedBody:
        """See `Body`; requests the state once a second."""
        while self._link.recv_msg() is not None:
            pass
        if now_s > self._requested_s + REQUEST_S and self._link.target_system:
            self._requested_s = now_s
            words = (self._number, 1e6 / RATE_HZ, 0, 0, 0, 0, 0)
            command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
            self._link.mav.command_long_send(self._link.target_system, 1, command, 0, *words)
        if self._name not in self._link.messages:
            return TrackedBody(self._subject, (0.0, 0.0, 0.0), occluded=True)
        state = self._state_of(self._link.messages[self._name])
        if self._origin is None:
            self._origin = state
        first = self._origin
        east = METRES_PER_DEGREE * math.cos(math.radians(first.latitude_deg))
        place_m = (
            METRES_PER_DEGREE * (state.latitude_deg - first.latitude_deg),
            -east * (state.longitude_deg - first.longitude_deg),
            state.height_m - first.height_m,
        )
        # y points left here, and z up: half a turn about x on both sides.
        w, x, y, z = state.rotation
        return TrackedBody(self._subject, place_m, (x, -y, -z, w))


def show(bodies: Sequence[Body], port: int, ended: Callable[[], bool] = lambda: False) -> None:
    """Serve a Tracker at a local port."""
    tracker = TrackerServer("127.0.0.1", port, rate_hz=RATE_HZ)
    start_s, frame = time.monotonic(), 0
    while not ended():
        now_s = time.monotonic()
        tracker.poll()
        tracker.publish(TrackerFrame(frame, tuple(one.body(now_s) for one in bodies)))
        frame += 1
        time.sleep(max(start_s + frame / RATE_HZ - time.monotonic(), 0.0))
    tracker.close()


def main(text: str | None, kind: Callable[[str], Body], metavar: str) -> None:
    """Show the vehicles that the command line names."""
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("vehicles", nargs="+", type=kind, metavar=metavar)
    parser.add_argument("--port", type=int, default=18801)
    arguments = parser.parse_args()
    show(arguments.vehicles, arguments.port)
