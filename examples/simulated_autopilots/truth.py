"""A Tracker that shows the true states of simulations."""

import argparse
import math
import random
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_frame import TrackedBody, TrackerFrame
from rcopterx.vehicles.state import Array

RATE_HZ = 50.0
REQUEST_S = 1.0
METRES_PER_DEGREE = 111_319.5
NOISE_M = 2e-4  # of a Tracker: poses that repeat themselves exactly count as frozen
TRUST_HZ = 5.0  # share of the difference to the position that velocity predicts, corrected in each second
PREDICTED_S = 0.1  # from the newest message on; later the vehicle is occluded, and found again
MOVED_M = 0.3  # a greater difference is no coarse step: the simulation has put the vehicle elsewhere


class Body(Protocol):
    """A subject of the Tracker."""

    def body(self, now_s: float) -> TrackedBody:
        """Newest pose; occluded without one."""


class TrueState(NamedTuple):
    """Latitude and longitude [degrees], height [m], rotation as w, x, y, z in north, east, down, velocity."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    rotation: Sequence[float]
    velocity_m_s: Sequence[float]
    """North, east, down."""


class Origin:
    """Where the Tracker's origin is: `state`, that of the vehicle that is seen first."""

    state: TrueState | None = None


class SmoothPath:
    """Follows positions in steps of 10 mm, which arrive late or several at once, by their velocities."""

    def __init__(self, rate_hz: float = RATE_HZ) -> None:
        self._used_s, self._trust = -math.inf, TRUST_HZ / rate_hz
        self._place_m = self._velocity_m_s = np.zeros(3)

    def use(self, place_m: Sequence[float], velocity_m_s: Sequence[float], now_s: float) -> None:
        """Use a position and its velocity."""
        difference_m = np.array(place_m) - self.at(now_s)
        moved = not self.seen(now_s) or float(np.abs(difference_m).max()) > MOVED_M
        self._place_m = self.at(now_s) + (1.0 if moved else self._trust) * difference_m
        self._velocity_m_s, self._used_s = np.array(velocity_m_s), now_s

    def seen(self, now_s: float) -> bool:
        """Whether a position is new enough."""
        return now_s <= self._used_s + PREDICTED_S

    def at(self, now_s: float) -> Array:
        """Position now."""
        elapsed_s = now_s - self._used_s if self.seen(now_s) else 0.0
        return self._place_m + elapsed_s * self._velocity_m_s


class MavlinkTruth:
    """A simulation that sends its true state as one message of MAVLink, at a rate; text `SUBJECT=LINK`.

    Links are written as pymavlink does. x points north, y west, z up.
    """

    def __init__(
        self,
        text: str,
        number: int,
        state_of: Callable[[Any], TrueState],
        origin: Origin | None = None,
        rate_hz: float = RATE_HZ,
    ) -> None:
        self._subject, _, link = text.partition("=")
        self._link = mavutil.mavlink_connection(link, source_system=254)
        self._number, self._state_of = number, state_of
        self._name = mavlink.mavlink_map[number].msgname
        self._requested_s, self._path, self._rate_hz = -math.inf, SmoothPath(rate_hz), rate_hz
        self._origin = origin or Origin()
        self._rotation: Sequence[float] = ()

    def body(self, now_s: float) -> TrackedBody:
        """See `Body`; requests the state once a second."""
        while (message := self._link.recv_msg()) is not None:
            if message.get_type() == self._name:
                self._use(self._state_of(message), now_s)
        if now_s > self._requested_s + REQUEST_S and self._link.target_system:
            self._requested_s = now_s
            words = (self._number, 1e6 / self._rate_hz, 0, 0, 0, 0, 0)
            command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
            self._link.mav.command_long_send(self._link.target_system, 1, command, 0, *words)
        if not self._path.seen(now_s):
            return TrackedBody(self._subject, (0.0, 0.0, 0.0), occluded=True)
        # y points left here, and z up: half a turn about x on both sides.
        w, x, y, z = self._rotation
        x_m, y_m, z_m = (random.gauss(part_m, NOISE_M) for part_m in self._path.at(now_s).tolist())
        return TrackedBody(self._subject, (x_m, y_m, z_m), (x, -y, -z, w))

    def _use(self, state: TrueState, now_s: float) -> None:
        self._origin.state = first = self._origin.state or state
        east = METRES_PER_DEGREE * math.cos(math.radians(first.latitude_deg))
        place_m = (
            METRES_PER_DEGREE * (state.latitude_deg - first.latitude_deg),
            -east * (state.longitude_deg - first.longitude_deg),
            state.height_m - first.height_m,
        )
        north_m_s, east_m_s, down_m_s = state.velocity_m_s
        self._path.use(place_m, (north_m_s, -east_m_s, -down_m_s), now_s)
        self._rotation = state.rotation


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
