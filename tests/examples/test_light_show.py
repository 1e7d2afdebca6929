"""Promises of drone shows: what the file says is what is flown and shown, and bad files are rejected."""

import json
import zipfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.example_programs import light_programs, light_show

from rcopterx import RefusedError
from rcopterx.bus.session import RequestFailedError
from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx_studies.importing import skybrush

LINE = [[0, [0, 0, 0], []], [4, [0, 0, 10], []], [8, [10, 0, 10], []]]
STILL = np.zeros(2)
CURVE = [[0, [0, 5, 0], []], [8, [10, 5, 10], [[0, 5, 10], [10, 5, 0]]]]


def trajectory(points: list[Any], **more: Any) -> dict[str, Any]:
    return {"version": 1, "points": points, **more}


def show(place: dict[str, Any]) -> dict[str, Any]:
    return {"swarm": {"drones": [{"settings": {"trajectory": place}}]}}


def archive(path: Path, files: dict[str, Any]) -> Path:
    with zipfile.ZipFile(path, "w") as target:
        for name, content in files.items():
            target.writestr(name, content if isinstance(content, str) else json.dumps(content))
    return path


def skyc(path: Path, *trajectories: dict[str, Any], by_reference: bool = True) -> Path:
    files: dict[str, Any] = {}
    drones = []
    for number, content in enumerate(trajectories, 1):
        place: dict[str, Any] = content
        if by_reference:
            files[f"drones/Drone {number}/trajectory.json"] = content
            place = {"$ref": f"./drones/Drone {number}/trajectory.json#"}
        drones.append({"type": "generic", "settings": {"name": f"Drone {number}", "trajectory": place}})
    return archive(path, {"show.json": {"version": 1, "swarm": {"drones": drones}}, **files})


@pytest.mark.parametrize("by_reference", [True, False])
def test_a_skyc_file_is_read_with_its_curves_and_its_time_of_take_off(
    by_reference: bool, tmp_path: Path
) -> None:
    curve = trajectory(CURVE, takeoffTime=2.0)
    path = skyc(tmp_path / "a.skyc", trajectory(LINE), curve, by_reference=by_reference)
    line, curved = skybrush.read_show(path)
    assert (line.name, curved.name) == ("Drone 1", "Drone 2")
    assert (line.times_s[0], line.times_s[-1]) == (0.0, 8.0)
    assert (curved.times_s[0], curved.times_s[-1]) == (2.0, 10.0)
    at_6_s = [np.interp(6.0, drone.times_s, drone.positions_m[:, 0]) for drone in (line, curved)]
    assert at_6_s == pytest.approx([5.0, 5.0])
    half = np.argmin(np.abs(curved.times_s - 4.0))
    share = 0.25
    assert curved.positions_m[half] == pytest.approx([10 * (3 * share**2 * (1 - share) + share**3), 5,
        10 * (3 * share * (1 - share) ** 2 + share**3)])  # fmt: skip


def test_a_zip_of_csv_files_is_read(tmp_path: Path) -> None:
    header = "Time [msec],x [m],y [m],z [m],Red,Green,Blue\n"
    files = {
        f"{name}.csv": f"{header}0,{x},0,1,255,0,0\n2000,{x},1,1,0,0,0\n" for name, x in (("b", 1), ("a", 0))
    }
    first, second = skybrush.read_show(archive(tmp_path / "show.zip", files))
    assert (first.name, second.name) == ("a.csv", "b.csv")
    assert second.times_s.tolist() == [0.0, 2.0]
    assert second.positions_m.tolist() == [[1.0, 0.0, 1.0], [1.0, 1.0, 1.0]]


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        ({}, "neither show.json nor CSV"),
        ({"show.json": "{"}, "show.json: no JSON"),
        ({"show.json": {"swarm": {}}}, "'drones'"),
        ({"show.json": show({"$ref": "./x#"})}, "x is missing"),
        ({"show.json": show({"version": 2})}, "version 2"),
        ({"a.csv": "t,x,y,z\n0,1,two,3\n"}, "a.csv: line 2: 'two' is not a number"),
        ({"a.csv": "t,x,y\n0,1,2\n"}, "a.csv: line 2: needs the columns"),
        ({"a.csv": "t,x,y,z\n5,0,0,0\n5,1,1,1\n"}, "a.csv: times must increase"),
    ],
)
def test_what_is_no_show_is_told(files: dict[str, Any], reason: str, tmp_path: Path) -> None:
    with pytest.raises(skybrush.ShowError, match=reason):
        skybrush.read_show(archive(tmp_path / "bad.skyc", files))


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        ([], "not enough values"),
        ([[0, [0, 0, 0], []]], "at least two positions"),
        ([[0, [0, 0, 0], []], [0, [1, 1, 1], []]], "does not come after"),
        ([[0, [0, 0, 0], []], [1, [1, 1], []]], "Drone 1"),
        ([[0, [0, 0, 0], []], [1e9, [1, 1, 1], []]], "does not come after"),
    ],
)
def test_a_trajectory_that_cannot_be_flown_is_told(points: list[Any], reason: str, tmp_path: Path) -> None:
    with pytest.raises(skybrush.ShowError, match=reason):
        skybrush.read_show(skyc(tmp_path / "bad.skyc", trajectory(points)))


def test_a_file_that_is_no_archive_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.skyc").write_text("no zip")
    with pytest.raises(skybrush.ShowError, match="not a zip file"):
        skybrush.read_show(tmp_path / "a.skyc")


@given(st.floats(0.5, 100.0), st.floats(-50.0, 50.0))
def test_a_show_of_any_size_fits_into_the_volume_and_keeps_its_shape_from_above(
    size: float, place: float
) -> None:
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    drones = [
        skybrush.Drone(
            str(number), np.array([0.0, 5.0]), place + size * (corners + np.array([0.0, number, 0.0])), STILL
        )
        for number in range(2)
    ]
    low_m, high_m = (-1.0, -1.0, 0.5), (1.0, 1.0, 1.7)
    if size < 0.5 * 1.001:
        return
    shrunk = light_show.fitted(drones, low_m, high_m)
    for drone in shrunk:
        assert (drone.positions_m >= np.array(low_m) - 1e-9).all()
        assert (drone.positions_m <= np.array(high_m) + 1e-9).all()
    gaps = [np.linalg.norm(found[0].positions_m[0] - found[1].positions_m[0]) for found in (drones, shrunk)]
    ways = [np.ptp(found[0].positions_m[:, 0]) for found in (drones, shrunk)]
    assert gaps[1] / gaps[0] == pytest.approx(ways[1] / ways[0])


def test_a_show_that_is_too_tight_for_the_volume_is_refused() -> None:
    line = np.array([[0.0, 0.0, 1.0], [40.0, 0.0, 1.0]])
    drones = [
        skybrush.Drone(str(y), np.array([0.0, 9.0]), line + np.array([0.0, y, 0.0]), STILL)
        for y in (0.0, 2.0)
    ]
    with pytest.raises(skybrush.ShowError, match=r"0.0 and 2.0 are 0.10 m from each other"):
        light_show.fitted(drones, (-1.0, -1.0, 0.5), (1.0, 1.0, 1.7))


def test_everybody_stays_where_he_is_before_and_after_his_own_part() -> None:
    line = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    drone = skybrush.Drone("late", np.array([2.0, 4.0]), line, np.array([0.0, 7.0]))
    path = light_show.path_of(drone, 0.0, 10.0, slower=2.0)
    assert path.duration_s == pytest.approx(20.0)
    ends = path.sample(np.array([0.0, 20.0]))
    assert ends[:, 0] == pytest.approx([0.0, 1.0])
    assert ends[:, 3] == pytest.approx([0.0, 7.0]), "a whole turn is one"


class FakeVehicle:
    """A vehicle with lights, or without; it fails to answer `fails` times."""

    def __init__(self, name: str, *, has_lights: bool = True, fails: int = 0) -> None:
        self.name, self.has_lights, self.fails = name, has_lights, fails
        self.colours: list[tuple[int, int, int]] = []

    def light(self, colour: tuple[int, int, int]) -> None:
        if not self.has_lights:
            raise RefusedError(f"{self.name}: no lights")
        if self.fails:
            self.fails -= 1
            raise RequestFailedError(f"{self.name}: no answer")
        assert all(0 <= part <= 255 for part in colour)
        self.colours.append(colour)


class FakeFleet:
    """A fleet whose vehicles have this left of their trajectories, one number after each status."""

    def __init__(self, left_s: dict[str, Sequence[float]], **vehicles: FakeVehicle) -> None:
        self._left_s = left_s
        self._vehicles = {name: vehicles.get(name, FakeVehicle(name)) for name in left_s}
        self._status = 0
        self.age_s = 0.1

    def __getitem__(self, name: str) -> FakeVehicle:
        return self._vehicles[name]

    def wait(self, seconds: float) -> None:
        assert seconds == light_show.STATUS_S
        self._status += 1

    def state_of(self, name: str) -> SimpleNamespace:
        left_s = self._left_s[name]
        agent = SimpleNamespace(path_left_s=left_s[min(self._status, len(left_s) - 1)])
        return SimpleNamespace(agent=agent, agent_age_s=self.age_s)


RED_TO_BLUE = light_programs.Lights(np.array([0.0, 10.0]), np.array([[250.0, 0.0, 0.0], [0.0, 0.0, 250.0]]))


def played(fleet: FakeFleet, slower: float = 1.0, begin_s: float = 0.0) -> list[str]:
    """Play ten seconds of lights that fade from red to blue; who leaves early."""
    names = list(fleet._vehicles)
    drone = skybrush.Drone("a", np.array([0.0, 10.0]), np.zeros((2, 3)), STILL)
    path = light_show.path_of(drone, 0.0, 10.0, slower)
    lamps = light_show.Lamps(fleet, names)
    return light_show.play(
        fleet, lamps, dict.fromkeys(names, RED_TO_BLUE), dict.fromkeys(names, path), begin_s, slower
    )


def test_lights_are_off_then_follow_the_trajectory_and_are_off_again() -> None:
    fleet = FakeFleet({"h1": [11.0, 10.5, 10.0, 9.8, 5.0, 4.8, 0.2, 0.0]})
    assert played(fleet) == []
    assert fleet["h1"].colours == [
        (0, 0, 0), (250, 0, 0), (245, 0, 5), (125, 0, 125), (120, 0, 130), (5, 0, 245), (0, 0, 0)
    ]  # fmt: skip


def test_a_suspended_show_sends_no_colours_and_goes_on_without_a_step_back() -> None:
    fleet = FakeFleet({"h1": [6.0, 6.0, 5.0, *[5.0] * 20, 5.4, 5.2, 5.0, 4.0, 0.8, 0.0]})
    assert played(fleet) == []
    assert fleet["h1"].colours[1:-1] == [(150, 0, 100), (125, 0, 125), (100, 0, 150), (20, 0, 230)]


def test_a_slower_show_has_slower_lights() -> None:
    fleet = FakeFleet({"h1": [20.0, 20.0, 10.0, 0.5, 0.0]})
    assert played(fleet, slower=2.0) == []
    assert fleet["h1"].colours[1:-1] == [(250, 0, 0), (125, 0, 125), (5, 0, 245)]


def test_vehicles_that_are_called_home_are_dark_and_told_while_others_go_on(
    capsys: pytest.CaptureFixture[str],
) -> None:
    # On its way home a vehicle flies another trajectory.
    fleet = FakeFleet({"h1": [8.0, 8.0, 0.0, 7.0, 6.9], "h2": [8.0, 8.0, 7.0, 6.0, 0.5, 0.0]})
    assert played(fleet) == ["h1"]
    assert fleet["h1"].colours[-2:] == [(200, 0, 50), (0, 0, 0)]
    assert fleet["h2"].colours[-2:] == [(10, 0, 240), (0, 0, 0)]
    assert "h1 leaves the show 8 s before its end" in capsys.readouterr().out


def test_a_vehicle_whose_agent_is_silent_for_long_does_not_hold_up_the_end() -> None:
    fleet = FakeFleet({"h1": [8.0]})
    fleet.age_s = light_show.LOST_S + 1.0
    assert played(fleet) == []


def test_vehicles_without_lights_fly_and_are_told_once(capsys: pytest.CaptureFixture[str]) -> None:
    fleet = FakeFleet(
        {"h1": [9.0, 5.0, 1.0, 0.0], "h2": [9.0, 5.0, 1.0, 0.0]}, h1=FakeVehicle("h1", has_lights=False)
    )
    assert played(fleet) == []
    assert capsys.readouterr().out == "without lights: h1\n"
    assert len(fleet["h2"].colours) == 4


def test_a_colour_that_was_not_answered_is_sent_again() -> None:
    fleet = FakeFleet({"h1": [9.0, 5.0, 5.0, 1.0, 0.0]}, h1=FakeVehicle("h1", fails=2))
    assert played(fleet) == []
    assert fleet["h1"].colours == [(125, 0, 125), (25, 0, 225), (0, 0, 0)]


@given(st.lists(st.floats(0.001, 10.0), min_size=1, max_size=100))
def test_colours_are_sent_only_when_they_have_changed(left_s: list[float]) -> None:
    fleet = FakeFleet({"h1": [10.0, *left_s, 0.0]})
    played(fleet)
    colours = fleet["h1"].colours
    assert colours[0] == colours[-1] == (0, 0, 0)
    assert all(one != other for one, other in pairwise(colours))
    assert len(colours) <= len(left_s) + 2


def test_a_drone_without_lights_is_dark() -> None:
    drone = skybrush.Drone("a", np.array([0.0, 10.0]), np.zeros((2, 3)), STILL)
    assert light_show.colour_of(light_programs.played(drone), 1.0) == (0, 0, 0)


@pytest.mark.parametrize(("turns", "refused"), [(1.0, False), (4.0, True)])
def test_a_show_that_turns_faster_than_its_vehicles_is_refused_before_it_begins(
    turns: float, refused: bool
) -> None:
    file = load_fleet(fleet_path("trio"))
    times_s = np.arange(0.0, 8.1, 0.25)
    yaws_rad = np.interp(times_s, [1.0, 7.0], [0.0, 2.0 * np.pi * turns])
    drone = skybrush.Drone("a", times_s, np.tile([0.0, 0.0, 1.0], (len(times_s), 1)), yaws_rad)
    paths = {"h2": light_show.path_of(drone, 0.0, 8.0, 1.0)}
    if refused:
        with pytest.raises(skybrush.ShowError, match=r"h2: .* yaw rate .* times as slow it could be flown"):
            light_show.check_limits(file, paths)
        paths = {"h2": light_show.path_of(drone, 0.0, 8.0, 3.0)}
    light_show.check_limits(file, paths)
