"""Fly a vehicle that leads with a gamepad: python gamepad.py VEHICLE [FLEET]. See docs/lab_day.md.

Sticks are velocities in the heading frame of the vehicle while the left shoulder button is held. Without it,
if the gamepad is unplugged, or if this program ends, the vehicle comes to rest. Needs rcopterx[gamepad].
"""

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final, Protocol

from rcopterx import Fleet, NotReachedError

KEY, AXIS = 1, 3  # types of events and their codes: linux/input-event-codes.h
LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y = 0, 1, 3, 4
SOUTH, EAST, NORTH, LEFT_SHOULDER = 304, 305, 307, 310
ACTIONS: Final = {SOUTH: "hold", NORTH: "land", EAST: "kill"}
DEAD_ZONE: Final = 0.15  # share of an axis around its middle: sticks do not return exactly
FASTEST: Final = (0.5, 0.5, 0.3, 1.0)  # forward, left, up [m/s], turning to the left [rad/s]
GROWTH: Final = (0.8, 0.8, 0.6, 2.0)  # of these speeds in a second
PERIOD_S: Final = 0.1  # between two set points
INSIDE_M: Final = 0.2  # distance of set points from the borders of the flight volume
PROBLEMS: Final = (RuntimeError, NotReachedError)  # a request that was refused or failed, or took too long

Four = tuple[float, float, float, float]
STILL: Final[Four] = (0.0, 0.0, 0.0, 0.0)


class Event(Protocol):
    """A change of an axis or a button, as `evdev.InputEvent`."""

    type: int
    code: int
    value: int


class Device(Protocol):
    """A gamepad, as `evdev.InputDevice`."""

    def read_one(self) -> Event | None:
        """Return the next event, None without one; `OSError` once it is unplugged."""

    def absinfo(self, axis: int) -> Any:
        """Return the range of an axis: `min`, `max`."""


@dataclass
class Pad:
    """The state of a gamepad: `axes` from -1 to 1, and the buttons that are pressed."""

    axes: dict[int, float] = field(default_factory=dict)
    pressed: set[int] = field(default_factory=set)

    def take(self, event: Event, ranges: dict[int, tuple[int, int]]) -> str:
        """Take an event; return the action that it asks for, empty for none."""
        if event.type == AXIS and event.code in ranges:
            self.axes[event.code] = share_of(event.value, *ranges[event.code])
        elif event.type == KEY and event.value == 0:
            self.pressed.discard(event.code)
        elif event.type == KEY and event.value == 1:
            self.pressed.add(event.code)
            return ACTIONS.get(event.code, "")
        return ""

    @property
    def velocity(self) -> Four:
        """Velocity that the sticks ask for, as `FASTEST`; none unless the dead-man button is held."""
        if LEFT_SHOULDER not in self.pressed:
            return STILL
        # Sticks count down and to the right; the left one moves, the right one climbs and turns.
        forward, left, up, turn = (
            -fastest * self.axes.get(axis, 0.0)
            for fastest, axis in zip(FASTEST, (LEFT_Y, LEFT_X, RIGHT_Y, RIGHT_X), strict=True)
        )
        return forward, left, up, turn


def share_of(value: int, low: int, high: int) -> float:
    """Return the deflection of an axis from -1 to 1; 0 in its dead zone, from which it grows evenly."""
    if low >= high:
        return 0.0
    share = min(max(2.0 * (value - low) / (high - low) - 1.0, -1.0), 1.0)
    return math.copysign(max(abs(share) - DEAD_ZONE, 0.0) / (1.0 - DEAD_ZONE), share)


@dataclass(frozen=True)
class SetPoint:
    """A set point in the inertial frame that moves with a velocity in its heading frame."""

    position_m: tuple[float, float, float]
    yaw_rad: float
    velocity: Four = STILL

    def moved(self, wanted: Four, period_s: float, low_m: Any, high_m: Any) -> "SetPoint":
        """Return it after a period in which its velocity approaches the wanted one, within a volume."""
        forward, left, up, turn = velocity = _approached(self.velocity, wanted, period_s)
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        speeds = cosine * forward - sine * left, sine * forward + cosine * left, up
        x, y, z = (
            min(max(place + period_s * speed, low + INSIDE_M), high - INSIDE_M)
            for place, speed, low, high in zip(self.position_m, speeds, low_m, high_m, strict=True)
        )
        return SetPoint((x, y, z), math.remainder(self.yaw_rad + period_s * turn, math.tau), velocity)


def _approached(velocity: Four, wanted: Four, period_s: float) -> Four:
    forward, left, up, turn = (
        speed + min(max(goal - speed, -period_s * growth), period_s * growth)
        for speed, goal, growth in zip(velocity, wanted, GROWTH, strict=True)
    )
    return forward, left, up, turn


class Flier:
    """Flies a vehicle with gamepads, one after the other: `step` once in a period."""

    def __init__(self, fleet: Fleet, vehicle: str, say: Callable[[str], None] = print) -> None:
        self._fleet, self._vehicle, self._say = fleet, fleet[vehicle], say
        self._device: Device | None = None
        self._ranges: dict[int, tuple[int, int]] = {}
        self._pad = Pad()
        self._set_point: SetPoint | None = None  # while it moves

    def plug_in(self, device: Device) -> None:
        """Use a gamepad."""
        axes = {axis: device.absinfo(axis) for axis in (LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y)}
        self._ranges = {axis: (info.min, info.max) for axis, info in axes.items()}
        self._device, self._pad = device, Pad()

    @property
    def plugged_in(self) -> bool:
        """Whether there is a gamepad."""
        return self._device is not None

    def step(self) -> None:
        """Obey what the gamepad has sent; move the set point while the dead-man button is held."""
        try:
            for action in self._actions():
                self._act(action)
        except OSError:
            self._say(f"gamepad unplugged: {self._vehicle.name} comes to rest")
            self._device, self._pad = None, Pad()
        wanted, before = self._pad.velocity, self._set_point
        if before is None and wanted != STILL:
            before = self._present()
        if before is None:
            return
        volume = self._fleet.file.volume
        after = before.moved(wanted, PERIOD_S, volume.min_m, volume.max_m)
        self._set_point = None if after.velocity == STILL and wanted == STILL else after
        if after != before:
            self._go_to(after, before)

    def _actions(self) -> Iterator[str]:
        while self._device is not None and (event := self._device.read_one()) is not None:
            if action := self._pad.take(event, self._ranges):
                yield action

    def _present(self) -> SetPoint | None:
        """Return where the vehicle is to be now; None unless it flies and leads."""
        state = self._vehicle.state
        if state.agent is None or state.phase != "flying" or state.assigned:
            return None
        return SetPoint(state.agent.set_point.position_m, state.agent.set_point.yaw_rad)

    def _go_to(self, after: SetPoint, before: SetPoint) -> None:
        try:
            self._vehicle.go_to(after.position_m, after.yaw_rad)
        except PROBLEMS as error:
            self._say(str(error))
            self._set_point = replace(before, velocity=STILL)

    def _act(self, action: str) -> None:
        """Carry out what a button asks for; each of them ends the motion by the sticks."""
        self._set_point = None
        self._say(f"{action} {self._vehicle.name}")
        try:
            {"hold": self._vehicle.lead, "land": self._vehicle.land, "kill": self._vehicle.kill}[action]()
        except PROBLEMS as error:
            self._say(str(error))


def found_gamepad() -> Device | None:
    """Return the first gamepad that is plugged in; None without one."""
    import evdev

    for path in evdev.list_devices():
        device = evdev.InputDevice(path)
        if LEFT_SHOULDER in device.capabilities().get(KEY, ()):
            return device
        device.close()
    return None


def main(vehicle: str, fleet: str | None = None) -> None:
    """Join the fleet that is up, and fly until Ctrl-C."""
    with Fleet.connect(fleet) as running:
        running.wait_for_status()
        flier = Flier(running, vehicle)
        while True:
            if not flier.plugged_in and (device := found_gamepad()) is not None:
                flier.plug_in(device)
                print("gamepad found: hold the left shoulder button to fly")
            flier.step()
            running.wait(PERIOD_S)


if __name__ == "__main__":
    main(*sys.argv[1:])
