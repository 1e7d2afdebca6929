"""Commands of ROS 2 for a fleet: messages on topics become calls of the scripting interface.

One command after the other is carried out, except an emergency, which does not wait. Refusals are printed.
"""

import math
import queue
import struct
import threading

from ros_messages import FRAME_ID, PoseStamped

from rcopterx.control.interfaces import Measurement
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS

ALL = "all"
"""Name that stands for every vehicle of the fleet, except in `goal_pose`."""
WAITING = 10
"""Largest number of commands that wait."""


class CommandError(ValueError):
    """A message that is no command; the text says why."""


def goal_of(payload):
    """Position [m] and heading [rad] of a `geometry_msgs/PoseStamped`; raises CommandError."""
    try:
        message = PoseStamped.deserialize(payload)
    except (struct.error, ValueError) as error:
        raise CommandError(f"no PoseStamped: {error!r}") from None
    if message.header.frame_id not in ("", FRAME_ID):
        raise CommandError(f"frame {message.header.frame_id!r}: only {FRAME_ID!r} is known")
    place, turn = message.pose.position, message.pose.orientation
    position_m = (place.x, place.y, place.z)
    yaw_rad = Measurement.of_pose(position_m, (turn.x, turn.y, turn.z, turn.w)).yaw_rad
    if not all(map(math.isfinite, (*position_m, yaw_rad))):
        raise CommandError("every number must be finite")
    return position_m, yaw_rad


class Commands:
    """Carries out messages of a session of ROS 2 while it is open.

    `fleet` is a `rcopterx.Fleet`; `topic_key` returns the key of a topic with `*` in place of the vehicle.
    """

    def __init__(self, ros, fleet, topic_key, report=print):
        self._fleet, self._report = fleet, report
        self._calls = queue.Queue(WAITING)
        threading.Thread(target=self._work, daemon=True).start()
        named = {
            "goal_pose": self._goal,
            "takeoff": lambda vehicle, _: self._later(lambda: fleet.take_off(self._names(vehicle))),
            "land": lambda vehicle, _: self._later(lambda: fleet.land(self._names(vehicle))),
            "emergency": lambda vehicle, _: self._at_once(lambda: fleet.kill(self._names(vehicle) or ())),
        }
        self._subscribers = [
            ros.declare_subscriber(topic_key(f"{fleet.file.name}/*/{name}"), self._handler(name, act))
            for name, act in named.items()
        ]

    def _handler(self, name, act):
        def handle(sample):
            parts = str(sample.key_expr).split("/")
            vehicle = parts[parts.index(name) - 1]
            try:
                if vehicle != ALL and vehicle not in self._fleet.file.vehicles:
                    raise CommandError(f"there is no vehicle {vehicle!r}")
                act(vehicle, sample.payload.to_bytes())
            except CommandError as error:
                self._report(f"{name}: {error}")

        return handle

    @staticmethod
    def _names(vehicle):
        return None if vehicle == ALL else [vehicle]

    def _goal(self, vehicle, payload):
        if vehicle == ALL:
            raise CommandError("one vehicle flies to a place, not all")
        position_m, yaw_rad = goal_of(payload)
        self._later(lambda: self._fleet[vehicle].go_to(position_m, yaw_rad))

    def _later(self, call):
        try:
            self._calls.put_nowait(call)
        except queue.Full:
            raise CommandError(f"{WAITING} commands wait already") from None

    def _at_once(self, call):
        threading.Thread(target=self._carry_out, args=(call,), daemon=True).start()

    def _work(self):
        while True:
            self._carry_out(self._calls.get())

    def _carry_out(self, call):
        try:
            call()
        except FLIGHT_ERRORS as error:
            self._report(f"refused: {error}")
