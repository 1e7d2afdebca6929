"""A scripted gamepad flies the leader of a formation in its heading frame, until it is unplugged."""

import errno
import math
from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from integration_support import Flying, Truth
from support.example_programs import gamepad

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(240)]

HEADING_RAD = 0.5 * math.pi
FORMATION_M = 0.1


class ScriptedDevice:
    """A gamepad, as `evdev.InputDevice`; unplugged if so wanted."""

    def __init__(self) -> None:
        self.events, self.unplugged = deque[Any](), False

    def send(self, kind: int, code: int, value: int) -> None:
        self.events.append(SimpleNamespace(type=kind, code=code, value=value))

    def read_one(self) -> Any:
        if self.unplugged:
            raise OSError(errno.ENODEV, "No such device")
        return self.events.popleft() if self.events else None

    def absinfo(self, axis: int) -> Any:
        return SimpleNamespace(min=-32768, max=32767)


def test_a_gamepad_flies_the_leader_forward_and_one_that_is_unplugged_holds_it(
    fly: Callable[..., None],
) -> None:
    fly(fly_by_gamepad)


def fly_by_gamepad(flying: Flying) -> None:
    fleet, truth, device, said = flying.fleet, Truth(flying), ScriptedDevice(), list[str]()
    fleet.take_off(height_m=0.8, timeout_s=40)
    fleet["h1"].go_to((0.0, -0.4, 0.9), HEADING_RAD)
    fleet.wait_for_arrival(["h1"])
    fleet.wait_for_formation()
    flier = gamepad.Flier(fleet, "h1", said.append)
    flier.plug_in(device)

    def fly(seconds: float) -> np.ndarray:
        """Fly for a time; return where the leader is then, and check the formation on the way."""
        for _ in range(round(seconds / gamepad.PERIOD_S)):
            flier.step()
            fleet.wait(gamepad.PERIOD_S)
            errors_m = [fleet.state_of(name).error_m for name in ("h2", "h3")]
            assert all(error_m is not None and error_m < FORMATION_M for error_m in errors_m)
        vehicle = truth("h1")
        assert vehicle is not None
        return np.array(vehicle.position_m)

    before = fly(0.5)
    device.send(gamepad.AXIS, gamepad.LEFT_Y, -32768)
    assert np.linalg.norm(fly(1.0) - before) < 0.05, "the dead-man button is not held"
    device.send(gamepad.KEY, gamepad.LEFT_SHOULDER, 1)
    moved = fly(1.8) - before
    assert moved[1] > 0.25, "forward is along y, where its nose points"
    assert abs(moved[0]) < 0.1
    device.unplugged = True
    fly(2.0)
    assert said == ["gamepad unplugged: h1 comes to rest"]
    assert np.linalg.norm(fly(1.0) - fly(0.5)) < 0.05, "it rests"
    device = ScriptedDevice()
    flier.plug_in(device)
    device.send(gamepad.KEY, gamepad.NORTH, 1)
    flier.step()
    fleet.wait_until(lambda: not fleet["h1"].state.airborne, 20.0, "it does not land", ["h1"])
