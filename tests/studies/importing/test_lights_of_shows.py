"""Promises of the lights and headings of drone shows: what a file says is played, other bytes are errors."""

import base64
import json
import math
import time
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from support.example_programs import light_programs

from rcopterx_studies.importing.skybrush import Drone, ShowError, read_show

ARGUMENTS, Lights = light_programs.ARGUMENTS, light_programs.Lights
lights_of, played = light_programs.lights_of, light_programs.played

SHOWS = Path(__file__).parents[2] / "fixtures" / "import_skybrush"
LONGEST_S = 5.0  # on a busy computer; 0.1 s otherwise
LINE = {"version": 1, "takeoffTime": 1.0, "points": [[0, [0, 0, 1], []], [4, [0, 8, 1], []]]}

Command = tuple[Any, ...]  # set or fade with red, green, blue, ticks; sleep; until; pyro; or loop with others
BYTES = st.integers(0, 255)
TICKS = st.one_of(st.integers(0, 300), st.integers(0, 2**20))
COLOURS = st.one_of(
    st.just((0, 0, 0)), st.just((255,) * 3), BYTES.map(lambda x: (x,) * 3), st.tuples(*3 * [BYTES])
)
SIMPLE = st.one_of(
    st.tuples(st.sampled_from(("set", "fade")), COLOURS, TICKS),
    st.tuples(st.sampled_from(("sleep", "until")), TICKS),
    st.tuples(st.just("pyro"), BYTES),
    st.tuples(st.just("reset")),
)
COMMANDS = st.recursive(
    st.lists(SIMPLE, max_size=6),
    lambda inner: st.lists(
        st.one_of(SIMPLE, st.tuples(st.just("loop"), st.integers(1, 4), inner)), max_size=4
    ),
    max_leaves=8,
)


def number(value: int) -> bytes:
    low, rest = value & 127, value >> 7
    return bytes([low | 128]) + number(rest) if rest else bytes([low])


def encoded(commands: Sequence[Command]) -> bytes:
    """The byte code, with the shortest command for each colour."""
    return b"".join(map(encoded_one, commands))


def encoded_one(command: Command) -> bytes:
    match command:
        case ("set" | "fade" as kind, (red, green, blue), ticks):
            first = 4 if kind == "set" else 8
            if red != green or green != blue:
                return bytes([first, red, green, blue]) + number(ticks)
            if red in (0, 255):
                return bytes([first + 2 + (red == 255)]) + number(ticks)
            return bytes([first + 1, red]) + number(ticks)
        case ("sleep", ticks):
            return b"\x02" + number(ticks)
        case ("until", ticks):
            return b"\x03" + number(ticks)
        case ("pyro", mask):
            return bytes([20 + mask % 2, mask])
        case ("reset",):
            return b"\x01\x0e"
        case ("loop", rounds, inner):
            return bytes([12, rounds]) + encoded(inner) + b"\x0d"
    raise AssertionError(command)


class Player:
    """What the commands mean: pieces of time with a colour at their begin and end."""

    def __init__(self) -> None:
        self.now = self.since = 0
        self.colour = (0, 0, 0)
        self.pieces: list[tuple[int, int, tuple[int, ...], tuple[int, ...]]] = []

    def play(self, commands: Sequence[Command]) -> None:
        for command in commands:
            match command:
                case ("set", colour, ticks):
                    self.colour = colour
                    self.last(self.now + ticks, colour)
                case ("fade", colour, ticks):
                    self.last(self.now + ticks, colour)
                case ("sleep", ticks):
                    self.last(self.now + ticks, self.colour)
                case ("until", ticks):
                    self.last(max(self.now, self.since + ticks), self.colour)
                case ("reset",):
                    self.since = self.now
                case ("loop", rounds, inner):
                    for _ in range(rounds):
                        self.play(inner)

    def last(self, until: int, colour: tuple[int, ...]) -> None:
        self.pieces.append((self.now, until, self.colour, colour))
        self.now, self.colour = until, colour


def shown(lights: Lights, time_s: float) -> list[float]:
    return [float(np.interp(time_s, lights.times_s, part)) for part in lights.colours.T]


@settings(deadline=None)
@given(COMMANDS, st.booleans())
def test_the_colours_of_a_program_are_those_of_its_commands(commands: list[Command], ended: bool) -> None:
    lights = lights_of(encoded(commands) + ended * b"\x00rest")
    assert (np.diff(lights.times_s) >= 0.0).all()
    assert ((lights.colours >= 0) & (lights.colours <= 255)).all()
    player = Player()
    player.play(commands)
    for begin, end, first, last in player.pieces:
        if begin >= end or end > 50 * 3600:
            continue
        for share in (0.25, 0.75):
            wanted = np.array(first) + share * (np.array(last) - np.array(first))
            at_s = 0.02 * (begin + share * (end - begin))
            assert shown(lights, at_s) == pytest.approx(wanted, abs=1e-6)
    if player.now <= 50 * 3600:
        assert shown(lights, 0.02 * player.now + 1.0) == pytest.approx(player.colour)


@settings(deadline=None)
@given(st.one_of(st.binary(max_size=400), st.lists(st.sampled_from([*ARGUMENTS]), max_size=60).map(bytes)))
@example(b"\x0c\x00\x0d")
@example(b"\x0c\x00\x0b\x01\x0a\x01\x0d")
@example(b"\x0c\x00" * 300 + b"\x0d" * 300)
@example(b"\x02" + 4 * b"\xff" + b"\x7f")
@example(b"\x02" + 5 * b"\xff" + b"\x7f")
def test_any_bytes_are_lights_or_an_error_and_soon(program: bytes) -> None:
    begin_s = time.perf_counter()
    try:
        lights = lights_of(program)
    except ValueError as error:
        assert "light program" in str(error)  # noqa: PT017
    else:
        assert lights.times_s[0] == 0.0
        assert len(lights.times_s) == len(lights.colours) >= 1
    assert time.perf_counter() - begin_s < LONGEST_S


def test_an_endless_loop_is_played_for_an_hour() -> None:
    blink = lights_of(
        encoded([("set", (255, 0, 0), 50), ("set", (0, 0, 0), 50)]).join((b"\x0c\x00", b"\x0d"))
    )
    assert 3600.0 <= blink.times_s[-1] < 3603.0
    assert [shown(blink, at_s)[0] for at_s in (0.5, 1.5, 3598.5, 3599.5)] == [255.0, 0.0, 255.0, 0.0]


def drone_with(tmp_path: Path, **settings: Any) -> Drone:
    drone = {"settings": {"name": "one", "trajectory": LINE, **settings}}
    with zipfile.ZipFile(tmp_path / "a.skyc", "w") as archive:
        archive.writestr("show.json", json.dumps({"swarm": {"drones": [drone]}}))
        archive.writestr("parts/lights.json", json.dumps(program(b"\x07\x32")))
    (read,) = read_show(tmp_path / "a.skyc")
    return read


def program(code: bytes) -> dict[str, Any]:
    return {"version": 1, "data": base64.b64encode(code).decode()}


@pytest.mark.parametrize("lights", [program(b"\x07\x32"), {"$ref": "./parts/lights.json#"}])
def test_lights_of_a_skyc_are_in_place_or_in_another_file(lights: dict[str, Any], tmp_path: Path) -> None:
    drone = drone_with(tmp_path, lights=lights)
    assert drone.lights is not None
    assert shown(played(drone), 0.5) == [255.0, 255.0, 255.0]


@pytest.mark.parametrize("lights", [{}, {"lights": None}, {"lights": {}}])
def test_a_drone_may_have_no_lights(lights: dict[str, Any], tmp_path: Path) -> None:
    drone = drone_with(tmp_path, **lights)
    assert drone.lights is None
    assert (drone.yaws_rad == 0.0).all()


@pytest.mark.parametrize(
    ("lights", "reason"),
    [
        (program(b"\xbf"), "one: command 191 at byte 0 of the light program cannot be played"),
        (program(b"\x01\x12\x00"), "one: command 18 at byte 1 of the light program"),
        (program(b"\x10\x01\x02\x03\x05"), "one: command 16 at byte 0 of the light program"),
        (program(b"\x04\xff\x00"), "one: command 4 at byte 0 of the light program"),
        (program(b"\x0c\x00\x01\x0d"), "one: the light program runs more than 100000 commands"),
        ({"version": 2, "data": ""}, "one: version 2 of the lights, only 1 is known"),
        ({"version": 1, "data": "a"}, "one: .*base64|one: Invalid"),
        ({"version": 1, "data": "\u00e4"}, "one: .*ASCII"),
        ({"version": 1, "data": [1]}, "another kind"),
        ({"version": 1}, "KeyError.*'data'"),
        ({"$ref": "./none.json"}, "one: ./none.json is missing"),
        (17, "another kind"),
    ],
)
def test_lights_that_cannot_be_played_are_told(lights: Any, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ShowError, match=reason):
        played(drone_with(tmp_path, lights=lights))


@settings(deadline=None, max_examples=30)
@given(
    st.recursive(
        st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=3)),
        lambda inner: st.one_of(
            st.lists(inner, max_size=3),
            st.dictionaries(st.sampled_from(["version", "data", "setpoints", "autoYaw", "$ref"]), inner),
        ),
    ),
    st.sampled_from(["lights", "yawControl"]),
)
@example([], "yawControl")
@example({"version": 1, "setpoints": [1, 2]}, "yawControl")
@example({"version": 1, "setpoints": [[10**400, 0]]}, "yawControl")
@example({"version": 1, "setpoints": [[0, math.nan]]}, "yawControl")
@example({"version": 1, "autoYaw": True, "autoYawOffset": "much"}, "yawControl")
def test_any_json_is_a_part_of_a_drone_or_an_error(
    tmp_path_factory: pytest.TempPathFactory, content: Any, part: str
) -> None:
    try:
        drone = drone_with(tmp_path_factory.mktemp("show"), **{part: content})
        played(drone)
    except ShowError:
        return
    assert np.isfinite(drone.yaws_rad).all()


def test_headings_are_clockwise_degrees_with_whole_turns_from_the_beginning_of_the_show(
    tmp_path: Path,
) -> None:
    heading = {"version": 1, "setpoints": [[1, 0], [3, 90], [5, -720]]}
    drone = drone_with(tmp_path, yawControl=heading)
    found_deg = np.degrees(np.interp([0.0, 2.0, 3.0, 5.0], drone.times_s, drone.yaws_rad))
    assert found_deg == pytest.approx([0.0, -45.0, -90.0, 720.0])


@pytest.mark.parametrize(("offset_deg", "yaw_deg"), [(0, 90.0), (30, 60.0)])
def test_an_automatic_heading_is_along_the_way(offset_deg: float, yaw_deg: float, tmp_path: Path) -> None:
    heading = {"version": 1, "setpoints": [], "autoYaw": True, "autoYawOffset": offset_deg}
    drone = drone_with(tmp_path, yawControl=heading)
    assert np.degrees(drone.yaws_rad) == pytest.approx(yaw_deg)


def test_an_automatic_heading_without_a_way_is_zero(tmp_path: Path) -> None:
    up = {"version": 1, "points": [[0, [0, 0, 0], []], [4, [0, 0, 8], []]]}
    drone = drone_with(tmp_path, trajectory=up, yawControl={"version": 1, "setpoints": [], "autoYaw": True})
    assert (drone.yaws_rad == 0.0).all()


def test_headings_of_no_order_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ShowError, match="one: times of the headings must increase"):
        drone_with(tmp_path, yawControl={"version": 1, "setpoints": [[1, 0], [1, 90]]})


def table(tmp_path: Path, text: str) -> Drone:
    with zipfile.ZipFile(tmp_path / "show.zip", "w") as archive:
        archive.writestr("a.csv", text)
    (drone,) = read_show(tmp_path / "show.zip")
    return drone


def test_colours_of_a_table_are_those_of_its_columns(tmp_path: Path) -> None:
    drone = table(
        tmp_path, "Time [msec],x [m],y [m],z [m],Red,Green,Blue\n0,0,0,1,255,0,7\n2000,1,0,1,0,0,7\n"
    )
    assert drone.lights is not None
    assert shown(played(drone), 1.0) == [127.5, 0.0, 7.0]


@pytest.mark.parametrize("first", ["t,x,y,z,yaw,red,green", "t,x,y,z", "0,0,0,0,1,2,3"])
def test_a_table_has_colours_only_if_its_first_line_names_them(first: str, tmp_path: Path) -> None:
    assert table(tmp_path, f"{first}\n1000,0,0,1,900,900,900\n2000,1,0,1,0,0,0\n").lights is None


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("5,0,0,1,256,0,0", "a.csv: colours are from 0 to 255"),
        ("5,0,0,1,9", "a.csv: line 3: needs the columns"),
    ],
)
def test_colours_of_a_table_that_are_none_are_told(row: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ShowError, match=reason):
        table(tmp_path, f"t,x,y,z,r,g,b\n0,0,0,1,9,9,9\n{row}\n")


def test_a_show_with_lights_and_headings_is_read() -> None:
    first, second, third = read_show(SHOWS / "lights_and_headings.skyc")
    assert first.lights is not None
    assert [shown(played(first), at_s) for at_s in (0.5, 3.0, 9.0)] == [
        [0.0, 0.0, 0.0], [255.0, 0.0, 0.0], [0.0, 0.0, 255.0]
    ]  # fmt: skip
    assert np.degrees(second.yaws_rad[-1]) == pytest.approx(360.0)
    assert third.lights is None
    assert np.degrees(third.yaws_rad) == pytest.approx(0.0)
