"""Promises to newcomers: the likeliest mistakes each end in a line that says what is wrong and what to do."""

import os
import re
import socket
import sys
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import Result
from support.bus import own_address
from support.fleets import HARDWARE_PAIR, PAIR
from support.scripted import ScriptedVehicle
from typer.testing import CliRunner

from rcopterx.bus.host_messages import SubjectState, TrackerStatus
from rcopterx.command_line import app
from rcopterx.deploy.hosts.resources import check_resources
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.deploy.hosts.running import RunningFleet, recorded
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.scripting.notes import tracker_problems

Vehicles = dict[str, ScriptedVehicle]


def run(*arguments: str) -> Result:
    result = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "300", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def error_of(result: Result) -> str:
    """What a command that fails says, as one line without frames."""
    assert result.exit_code in (1, 2), result.output
    assert "Traceback" not in result.output
    return re.sub(r"[\s│╭╮╰╯─]+", " ", result.stderr)


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    return tmp_path / "lab.toml"


MISTAKES_IN_FILES = {
    "not TOML": ("name = lab", ("lab.toml: not TOML", "line 1")),
    "unknown key": (PAIR + "colour = 1", ("vehicles.h2: ", "unknown field `colour`, allowed are ")),
    "missing key": (
        PAIR.replace('subject = "heli2"', ""),
        ("vehicles.h2: ", "missing required field `subject`"),
    ),
    "unknown leader": (PAIR.replace('"h1", off', '"h7", off'), ("unknown vehicle 'h7', known are h1, h2",)),
    "follows itself": (PAIR.replace('"h1", off', '"h2", off'), ("h2 cannot follow itself",)),
    "leaders in a loop": (
        PAIR.replace(
            "model_match = 1 }", 'model_match = 1 }\nfollow = [{ leader = "h2", offset_m = [0, 1, 0] }]'
        ),
        ("a cycle of leaders: h1 -> h2 -> h1",),
    ),
    "unknown controller": (
        PAIR + 'control = { controller = "mpc" }',
        ("vehicles.h2.control: no controller is called 'mpc'; allowed are ", "cascade"),
    ),
    "misspelt key": (PAIR + "contrl = {}", ("unknown field `contrl`, ", "; did you mean 'control'?")),
    "misspelt key of a model": (
        PAIR + "model = { hover_trust = 0.5 }",
        ("vehicles.h2.model.hover_trust: unknown field, ", "; did you mean 'hover_thrust'?"),
    ),
    "misspelt setting": (
        PAIR + "control = { settings = { horizn = 30 } }",
        ("unknown setting 'horizn'; ", "; did you mean 'horizon'?"),
    ),
    "misspelt leader": (
        PAIR.replace("h1", "hugo").replace('leader = "hugo"', 'leader = "huga"'),
        ("unknown vehicle 'huga', known are hugo, h2; did you mean 'hugo'?",),
    ),
    "same subject twice": (PAIR.replace("heli2", "heli1"), ("'heli1' is already that of vehicles.h1",)),
    "same port twice": (PAIR.replace("radio-h2", "radio-h1"), ("'radio-h1' is already that of vehicles.h1",)),
    "no such device": (HARDWARE_PAIR, ("vehicles.h1.transmitter.port: there is no device",)),
    "formation wider than the volume": (
        PAIR.replace("-0.4, 0.5, 0.0", "-0.4, 9.0, 0.0"),
        ("h1 and h2 would be 9 m apart in y, the flight volume is 2.4 m there",),
    ),
}


@pytest.mark.parametrize(("text", "words"), MISTAKES_IN_FILES.values(), ids=MISTAKES_IN_FILES)
def test_a_mistake_in_the_fleet_file(text: str, words: tuple[str, ...], lab: Path) -> None:
    port = own_address().endpoints[0].rpartition(":")[2]
    lab.write_text(text if "not TOML" in words[0] else f"{text}\n[hosts.main]\nrouter_port = {port}\n")
    line = error_of(run("up", str(lab)))
    assert line.startswith(f"error: {lab}: " if str(lab) in line else "error: ")
    assert all(word in line for word in words), line


MISTAKES_IN_COMMANDS = {
    "no fleet is up": (("takeoff",), ("no fleet is up on this computer; start one (rcopterx up FLEET)",)),
    "fleet file missing": (("up", "labb.toml"), ("labb.toml: no such file; shipped fleets are ", "trio")),
    "misspelt fleet": (("up", "tria"), ("tria: no such file; ", "; did you mean 'trio'?")),
    "misspelt fault": (
        ("inject", "clos", "-f", "trio"),
        ("unknown fault 'clos', ", "; did you mean 'close'?"),
    ),
    "misspelt manoeuvre": (("fly", "hovr"), ("unknown manoeuvre 'hovr', ", "; did you mean 'hover'?")),
    "fleet file is a directory": (("up", "."), ("a directory; name the fleet file in it",)),
    "negative height": (("takeoff", "--height", "-1"), ("--height", "0.2")),
    "follows itself": (("follow", "h1", "h1"), ("h1 cannot follow itself, name another vehicle",)),
    "misspelt command": (("take-off",), ("No such command 'take-off'",)),
    "offset of two numbers": (("follow", "h2", "h1", "--offset", "1,2"), ("three numbers",)),
    "own file wanted": (("identify", "h1", "-f", "trio"), ("trio", "copy")),
    "own file wanted, of a radio": (("calibrate", "h1", "-f", "trio"), ("comes with the package", "copy it")),
}


@pytest.mark.parametrize(("arguments", "words"), MISTAKES_IN_COMMANDS.values(), ids=MISTAKES_IN_COMMANDS)
def test_a_mistake_in_a_command(arguments: tuple[str, ...], words: tuple[str, ...]) -> None:
    line = error_of(run(*arguments))
    assert all(word in line for word in words), line


def test_several_fleets_are_up_and_none_is_named() -> None:
    with ExitStack() as stack:
        for name in ("lab", "trio"):
            running = RunningFleet(name, "d1", None, "main", ["tcp/127.0.0.1:7447"], [], ["h1"], "")
            stack.enter_context(recorded(run_directory(name, None), running))
        line = error_of(run("land"))
    assert "several fleets are up: lab, trio; name the file of one (-f FLEET)" in line


def test_a_second_fleet_on_the_same_port(lab: Path) -> None:
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        lab.write_text(f"{PAIR}\n[hosts.main]\nrouter_port = {busy.getsockname()[1]}\n")
        line = error_of(run("up", str(lab)))
    assert "is the fleet already up? Stop it, or give another port" in line


def test_no_rights_for_the_serial_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device = tmp_path / "ttyUSB0"
    device.touch()
    monkeypatch.setattr("rcopterx.deploy.hosts.resources.os.access", lambda *_: False)
    port = own_address().endpoints[0].rpartition(":")[2]
    text = HARDWARE_PAIR.replace("radio-h1", str(device)) + f"\n[hosts.main]\nrouter_port = {port}\n"
    with pytest.raises(ValueError, match=r"h1\.transmitter\.port: no permission for .*usermod -aG dialout"):
        check_resources(parse_fleet(text), "main", tmp_path)


def test_a_run_directory_that_cannot_be_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lab: Path
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path / "file"))
    lab.write_text(PAIR)
    line = error_of(run("up", str(lab)))
    assert "Not a directory; set RCOPTERX_RUN to a directory you may write to" in line


def test_two_vehicles_with_one_model_match_are_not_bound(lab: Path) -> None:
    lab.write_text(PAIR.replace("model_match = 2", "model_match = 1"))
    device = run_directory("lab", None) / "radio-h1"
    outside, inside = os.openpty()
    device.symlink_to(os.ttyname(inside))
    try:
        line = error_of(run("bind", "h1", "--yes", "-f", str(lab)))
    finally:
        os.close(outside)
        os.close(inside)
    assert "model_match: 1 is also that of h2; give every vehicle its own" in line


def test_the_page_without_its_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rcopterx.commands.ground.find_spec", lambda name: None)
    assert "pip install 'rcopterx[ground]'" in error_of(run("ground"))


def test_a_python_that_is_too_old() -> None:
    makefile = (Path(__file__).parents[2] / "Makefile").read_text(encoding="utf-8")
    (check,) = re.findall(r"\$\(PYTHON\) -c '(import sys; .*)'", makefile)
    ended: list[object] = []
    old = SimpleNamespace(version_info=(3, 10, 4), exit=ended.append)
    exec(check.removeprefix("import sys; "), {"sys": old})
    assert ended == ["Python 3.11 to 3.13 is needed, this is 3.10; try make PYTHON=python3.11"]
    assert sys.version_info[:2] >= (3, 11)


def test_a_subject_that_is_misspelt_and_a_tracker_that_does_not_stream() -> None:
    wrong = SubjectState(subject="heil2", vehicle="h2", listed=False)
    there = SubjectState(subject="heli2", listed=True)
    up = TrackerStatus(state="up", trying="", address="", subjects=(wrong, there))
    assert tracker_problems(up, 0.0, ["h2"]) == [
        "h2: subject 'heil2' is not in the Tracker's list (it lists: 'heli2')"
    ]
    away = TrackerStatus(state="connecting", trying="trying 10.0.0.5:801 again in 1.0 s (try 3)", address="")
    (line,) = tracker_problems(away, 0.0, ["h2"])
    assert line.startswith("Tracker: trying 10.0.0.5:801 again in 1.0 s (try 3); ")
    assert "does it run, and stream at tracker.address?" in line


def test_a_receiver_that_is_off_and_a_module_that_is_not_ready(up: str, vehicles: Vehicles) -> None:
    vehicles["h2"].ready = False
    assert "h2: transmitter not ready: module speaks" in run("check", "--wait", "0.2", "-f", up).output


def test_a_killed_vehicle_is_asked_to_take_off(up: str, vehicles: Vehicles) -> None:
    vehicles["h1"].state = "killed"
    line = error_of(run("takeoff", "h1", "-f", up))
    assert "killed: h1; reset first (rcopterx reset)" in line
    assert vehicles["h1"].requests == []


def test_an_unknown_vehicle(up: str) -> None:
    assert "unknown vehicle 'h7', known are h1, h2" in error_of(run("goto", "h7", "0", "0", "1", "-f", up))


def test_a_set_point_outside_of_the_volume(up: str, vehicles: Vehicles) -> None:
    vehicles["h1"].refusals["go_to"] = "x: 9 m is outside the flight volume -1.2 .. 1.2 m"
    line = error_of(run("goto", "h1", "9", "0", "1", "-f", up))
    assert line.strip() == "error: h1: x: 9 m is outside the flight volume -1.2 .. 1.2 m"


def test_a_fleet_of_several_hosts_without_daemons_says_how_to_start_it(lab: Path) -> None:
    port = own_address().endpoints[0].rpartition(":")[2]
    places = (
        f'[hosts.main]\nrouter_port = {port}\n[hosts.second]\naddress = "127.0.0.2"\nrouter_port = {port}\n'
    )
    lab.write_text(PAIR + places)
    line = error_of(run("up", str(lab)))
    assert "no host of the fleet answers: keep each ready with rcopterx host" in line
    assert "start its part with --host, one of main, second" in line
