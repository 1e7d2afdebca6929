"""Promises of the gamepad: limited speeds in the heading frame, a dead-man button, and rest without it."""

import errno
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.example_programs import gamepad

RANGES = {
    gamepad.LEFT_X: (-32768, 32767),
    gamepad.LEFT_Y: (-32768, 32767),
    gamepad.RIGHT_X: (0, 255),
    gamepad.RIGHT_Y: (0, 255),
}
LOW_M, HIGH_M = (-1.2, -1.2, 0.0), (1.2, 1.2, 2.0)
SHARES = st.floats(-1.0, 1.0)
VELOCITIES = st.tuples(*(st.floats(-fastest, fastest) for fastest in gamepad.FASTEST))
UINPUT = Path("/dev/uinput")


@dataclass(frozen=True)
class Recorded:
    """An event, as `evdev.InputEvent`."""

    type: int
    code: int
    value: int


def held(code: int) -> Recorded:
    return Recorded(gamepad.KEY, code, 1)


def released(code: int) -> Recorded:
    return Recorded(gamepad.KEY, code, 0)


def moved(axis: int, share: float) -> Recorded:
    low, high = RANGES[axis]
    return Recorded(gamepad.AXIS, axis, round(low + (high - low) * (share + 1.0) / 2.0))


# Of an Xbox pad, as `evtest` prints it, with events of synchronisation and of other axes.
RECORDING = (
    Recorded(0, 0, 0), Recorded(3, 2, 255), held(gamepad.LEFT_SHOULDER), Recorded(0, 0, 0),
    Recorded(3, gamepad.LEFT_Y, -32768), Recorded(0, 0, 0), Recorded(4, 4, 589825), Recorded(1, 304, 2),
)  # fmt: skip


class FakeDevice:
    """A gamepad as `evdev.InputDevice` with events that a test adds; it may be unplugged after them."""

    def __init__(self, events: Sequence[Recorded] = ()) -> None:
        self.events, self.unplugged = deque(events), False

    def read_one(self) -> Recorded | None:
        if self.events:
            return self.events.popleft()
        if self.unplugged:
            raise OSError(errno.ENODEV, "No such device")
        return None

    def absinfo(self, axis: int) -> Any:
        low, high = RANGES[axis]
        return SimpleNamespace(min=low, max=high)


class FakeVehicle:
    """A vehicle that leads and reaches every set point at once; `asked` is what was requested of it."""

    name = "h1"

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.places: list[tuple[float, float, float]] = []
        self.refuses = False
        point = SimpleNamespace(position_m=(0.0, 0.0, 1.0), yaw_rad=0.0)
        self.state = SimpleNamespace(agent=SimpleNamespace(set_point=point), phase="flying", assigned=())

    def go_to(self, position_m: tuple[float, float, float], yaw_rad: float) -> None:
        if self.refuses:
            raise RuntimeError("h2 would leave")
        self.places.append(position_m)
        self.state.agent.set_point = SimpleNamespace(position_m=position_m, yaw_rad=yaw_rad)

    def __getattr__(self, verb: str) -> Any:
        return lambda: self.asked.append(verb)


class Bench:
    def __init__(self) -> None:
        self.vehicle, self.device, self.said = FakeVehicle(), FakeDevice(), list[str]()
        volume = SimpleNamespace(min_m=LOW_M, max_m=HIGH_M)

        class FakeFleet(dict[str, FakeVehicle]):
            file = SimpleNamespace(volume=volume)

        self.flier = gamepad.Flier(FakeFleet(h1=self.vehicle), "h1", self.said.append)
        self.flier.plug_in(self.device)

    def run(self, seconds: float, *events: Recorded) -> list[tuple[float, float, float]]:
        """Send events, then fly; return the set points of that time."""
        self.device.events.extend(events)
        before = len(self.vehicle.places)
        for _ in range(round(seconds / gamepad.PERIOD_S)):
            self.flier.step()
        return self.vehicle.places[before:]


@given(st.integers(-40000, 40000), st.integers(-32768, 0), st.integers(0, 32767))
def test_any_value_of_an_axis_is_a_share_and_the_dead_zone_is_nothing(
    value: int, low: int, high: int
) -> None:
    share = gamepad.share_of(value, low, high)
    assert -1.0 <= share <= 1.0
    if low < high:
        plain = 2.0 * (value - low) / (high - low) - 1.0
        assert (share == 0.0) or math.copysign(1.0, share) == math.copysign(1.0, plain)
        assert (abs(plain) > gamepad.DEAD_ZONE) or share == 0.0
        assert gamepad.share_of(high, low, high) == 1.0
        assert gamepad.share_of(low, low, high) == -1.0


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 320), st.integers(-40000, 40000)), max_size=30))
def test_whatever_a_gamepad_sends_the_speeds_are_limited_and_zero_without_the_button(
    events: list[tuple[int, int, int]],
) -> None:
    pad = gamepad.Pad()
    for event in events:
        pad.take(Recorded(*event), RANGES)
        for speed, fastest in zip(pad.velocity, gamepad.FASTEST, strict=True):
            assert abs(speed) <= fastest
        if gamepad.LEFT_SHOULDER not in pad.pressed:
            assert pad.velocity == gamepad.STILL


def test_recorded_events_fly_forward_and_only_a_first_press_is_an_action() -> None:
    pad = gamepad.Pad()
    assert [pad.take(event, RANGES) for event in RECORDING] == [""] * len(RECORDING)
    assert pad.velocity == pytest.approx((gamepad.FASTEST[0], 0.0, 0.0, 0.0))
    assert pad.take(held(gamepad.EAST), RANGES) == "kill"
    assert pad.take(released(gamepad.EAST), RANGES) == ""


@given(VELOCITIES, VELOCITIES, st.floats(-math.pi, math.pi), st.tuples(SHARES, SHARES, st.floats(0.3, 1.7)))
def test_a_set_point_changes_its_speed_at_a_limited_rate_in_its_heading_frame_and_stays_inside(
    velocity: Any, wanted: Any, yaw_rad: float, position_m: Any
) -> None:
    point = gamepad.SetPoint(position_m, yaw_rad, velocity)
    after = point.moved(wanted, 0.1, LOW_M, HIGH_M)
    for before, now, goal, growth in zip(velocity, after.velocity, wanted, gamepad.GROWTH, strict=True):
        assert abs(now - before) <= 0.1 * growth + 1e-12
        assert abs(goal - now) <= abs(goal - before) + 1e-12
    for place, low, high in zip(after.position_m, LOW_M, HIGH_M, strict=True):
        assert low + gamepad.INSIDE_M <= place <= high - gamepad.INSIDE_M
    inside = all(abs(place) < 0.8 for place in position_m[:2])
    if inside:
        dx, dy = (new - old for new, old in zip(after.position_m[:2], position_m[:2], strict=True))
        forward = math.cos(yaw_rad) * dx + math.sin(yaw_rad) * dy
        assert forward == pytest.approx(0.1 * after.velocity[0], abs=1e-9)


def test_nothing_moves_before_the_dead_man_button_is_held_and_it_rests_soon_after() -> None:
    bench = Bench()
    assert bench.run(1.0, moved(gamepad.LEFT_Y, -1.0)) == []
    places = bench.run(2.0, held(gamepad.LEFT_SHOULDER))
    assert places[-1][0] == pytest.approx(0.5 * 2.0 - 0.5 * 0.5**2 / 0.8, abs=0.05)
    rest = bench.run(2.0, released(gamepad.LEFT_SHOULDER))
    assert rest[-1][0] - places[-1][0] < 0.25
    assert bench.run(1.0) == [], "at rest nothing is requested, so that others may command the vehicle"
    bench.run(0.5, moved(gamepad.LEFT_Y, 1.0), held(gamepad.LEFT_SHOULDER))
    assert bench.vehicle.places[-1][0] < rest[-1][0]


@pytest.mark.parametrize(("button", "asked"), [(304, "lead"), (307, "land"), (305, "kill")])
def test_buttons_end_the_motion(button: int, asked: str) -> None:
    bench = Bench()
    bench.run(1.0, held(gamepad.LEFT_SHOULDER), moved(gamepad.LEFT_X, -1.0))
    bench.device.events.append(released(gamepad.LEFT_SHOULDER))
    assert bench.run(1.0, held(button)) == []
    assert bench.vehicle.asked == [asked]


def test_a_gamepad_that_is_unplugged_in_motion_holds_the_vehicle_and_another_one_may_be_used() -> None:
    bench = Bench()
    places = bench.run(1.0, held(gamepad.LEFT_SHOULDER), moved(gamepad.LEFT_Y, -1.0))
    bench.device.unplugged = True
    assert bench.run(1.0)[-1][0] - places[-1][0] < 0.25
    assert bench.run(1.0) == []
    assert not bench.flier.plugged_in
    bench.device = FakeDevice()
    bench.flier.plug_in(bench.device)
    assert bench.run(1.0, moved(gamepad.LEFT_Y, -1.0)) == [], "the button has to be pressed anew"
    assert bench.run(1.0, held(gamepad.LEFT_SHOULDER))


def test_a_refused_set_point_stops_the_motion_and_is_said() -> None:
    bench = Bench()
    bench.run(0.5, held(gamepad.LEFT_SHOULDER), moved(gamepad.LEFT_Y, -1.0))
    last = bench.vehicle.places[-1]
    bench.vehicle.refuses = True
    bench.run(0.5)
    assert "h2 would leave" in bench.said
    bench.vehicle.refuses = False
    after = bench.run(0.2)
    assert math.dist(after[0], last) < 0.05


@pytest.mark.skipif(not UINPUT.exists(), reason="no /dev/uinput: the fake device sends the same events")
def test_a_virtual_gamepad_is_found_and_read() -> None:
    evdev = pytest.importorskip("evdev")
    axes = [(axis, evdev.AbsInfo(0, low, high, 0, 0, 0)) for axis, (low, high) in RANGES.items()]
    buttons = [gamepad.LEFT_SHOULDER, *gamepad.ACTIONS]
    with evdev.UInput({gamepad.KEY: buttons, gamepad.AXIS: axes}, name="virtual gamepad") as virtual:
        found = gamepad.found_gamepad()
        assert found is not None
        pad = gamepad.Pad()
        for event in (held(gamepad.LEFT_SHOULDER), moved(gamepad.LEFT_Y, -1.0)):
            virtual.write(event.type, event.code, event.value)
        virtual.syn()
        while (event := found.read_one()) is not None:
            pad.take(event, RANGES)
        assert pad.velocity[0] == pytest.approx(gamepad.FASTEST[0])
