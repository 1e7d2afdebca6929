"""Commands of ROS 2 for a fleet: messages and requests of services become calls of the scripting interface.

One command after the other is carried out, except an emergency, which does not wait. Refusals are printed.
"""

import math
import queue
import struct
import threading

import msgspec
from ros_messages import FRAME_ID, Empty, GoTo, Land, PoseStamped, Takeoff

from rcopterx.bus.requests import TakeOff
from rcopterx.control.interfaces import Measurement
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS

ALL = "all"
"""Name that stands for every vehicle of the fleet, except for a goal."""
TOPICS = ("goal_pose", "takeoff", "land", "emergency")
SERVICES = {"takeoff": Takeoff, "land": Land, "go_to": GoTo, "emergency": Empty}
"""Services by the last part of their name, and their requests; all responses are empty."""
RESPONSE = Empty().serialize()
WAITING = 10
"""Largest number of commands that wait."""


class CommandError(ValueError):
    """A message that is no command; the text says why."""


def decoded(kind, payload):
    """A message of ROS 2; raises CommandError."""
    try:
        return kind.deserialize(payload)
    except (struct.error, ValueError) as error:
        raise CommandError(f"no {kind.__name__}: {error!r}") from None


def goal_of(payload):
    """Position [m] and heading [rad] of a `geometry_msgs/PoseStamped`; raises CommandError."""
    message = decoded(PoseStamped, payload)
    if message.header.frame_id not in ("", FRAME_ID):
        raise CommandError(f"frame {message.header.frame_id!r}: only {FRAME_ID!r} is known")
    place, turn = message.pose.position, message.pose.orientation
    position_m = (place.x, place.y, place.z)
    yaw_rad = Measurement.of_pose(position_m, (turn.x, turn.y, turn.z, turn.w)).yaw_rad
    return finite(*position_m, yaw_rad)


def height_of(request):
    """Height [m] of a `Takeoff`; raises CommandError."""
    try:
        return msgspec.convert({"height_m": request.height}, TakeOff).height_m
    except msgspec.ValidationError as error:
        raise CommandError(str(error)) from None


def requested_goal(request, set_point):
    """Position [m] and heading [rad] of a `GoTo`, which may be relative to the set point of the vehicle."""
    goal = (request.goal.x, request.goal.y, request.goal.z, request.yaw)
    if request.relative:
        if set_point is None:
            raise CommandError("the vehicle has no set point that a relative goal could count from")
        start = (*set_point.position_m, set_point.yaw_rad)
        goal = tuple(first + more for first, more in zip(start, goal, strict=True))
    return finite(*goal)


def finite(x, y, z, yaw_rad):
    """Position and heading; raises CommandError."""
    if not all(map(math.isfinite, (x, y, z, yaw_rad))):
        raise CommandError("every number must be finite")
    return (x, y, z), yaw_rad


class Commands:
    """Carries out commands for a `rcopterx.Fleet`."""

    def __init__(self, fleet, report=print):
        self._fleet, self._report = fleet, report
        self._calls = queue.Queue(WAITING)
        threading.Thread(target=self._work, daemon=True).start()

    def receive(self, name, vehicle, payload):
        """Carry out what a topic of this name says; what cannot be carried out is reported."""
        try:
            self._accept(name, vehicle, goal_of(payload) if name == "goal_pose" else None)
        except CommandError as error:
            self._report(f"{name}: {error}")

    def answer(self, name, vehicle, payload):
        """Carry out a request to a service, and return its response; raises CommandError, also reported."""
        try:
            request = decoded(SERVICES[name], payload)
            self._accept(name, vehicle, request)
        except CommandError as error:
            self._report(f"{name}: {error}")
            raise
        return RESPONSE

    def _accept(self, name, vehicle, content):
        fleet, names = self._fleet, None if vehicle == ALL else [vehicle]
        if names and vehicle not in fleet.file.vehicles:
            raise CommandError(f"there is no vehicle {vehicle!r}")
        if name == "emergency":
            self._at_once(lambda: fleet.kill(names or ()))
        elif name == "land":
            self._later(lambda: fleet.land(names))
        elif name == "takeoff":
            height = {} if content is None else {"height_m": height_of(content)}
            self._later(lambda: fleet.take_off(names, **height))
        elif names is None:
            raise CommandError("one vehicle flies to a place, not all")
        else:
            goal = content if name == "goal_pose" else self._requested_goal(vehicle, content)
            self._later(lambda: fleet[vehicle].go_to(*goal))

    def _requested_goal(self, vehicle, request):
        agent = self._fleet[vehicle].state.agent
        return requested_goal(request, None if agent is None else agent.set_point)

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
