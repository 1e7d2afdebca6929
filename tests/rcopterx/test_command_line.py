"""Promises of the command line: complete help with units, and for every mistake a line and an exit code."""

import math
import re
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer
from click.testing import Result
from support.bus import free_port, own_address
from support.fleets import HARDWARE_PAIR, PAIR
from support.scripted import ScriptedVehicle, fleet_file_text
from support.waiting import wait_for
from typer.testing import CliRunner

from rcopterx.bus.requests import Follow, GoTo, TakeOff
from rcopterx.command_line import PLACES, app
from rcopterx.commands.fleet_option import chosen_host
from rcopterx.fleet.reading import fleet_path, load_fleet, shipped_fleets
from rcopterx.fleet.schema import FleetError
from rcopterx.ground_station.acceptance.manoeuvres import MANOEUVRES
from rcopterx.ground_station.scripting.fleet import Fleet

NAMES = list(PLACES)
UNITS = {
    "goto": ("metres", "degrees"),
    "follow": ("metres", "degrees"),
    "takeoff": ("metres",),
    "demo": ("seconds",),
}
Vehicles = dict[str, ScriptedVehicle]


def run(*arguments: str) -> Result:
    result = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert "Traceback" not in result.output
    return result


def plain(result: Result) -> str:
    """Output without frames and line breaks."""
    return re.sub(r"[\s│╭╮╰╯─]+", " ", result.output)


@pytest.fixture
def down(tmp_path: Path) -> str:
    """Fleet file of a fleet that is not up."""
    path = tmp_path / "down.toml"
    path.write_text(fleet_file_text(own_address()))
    return str(path)


def test_the_help_names_all_commands() -> None:
    shown = plain(run("--help"))
    for name in (*NAMES, "bench"):
        assert f" {name} " in shown
    assert "Lengths are metres, times seconds, angles on the command line degrees" in shown


FLEETLESS = (
    "arena", "experiment", "export", "flights", "import", "new-plugin", "recover", "replay", "replay-tracker",
    "report", "types", "udev-rules",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_every_command_explains_itself_and_its_options(name: str) -> None:
    result = run(name, "--help")
    assert result.exit_code == 0
    shown = plain(result)
    assert f"rcopterx {name}" in shown or f"root {name}" in shown
    for unit in UNITS.get(name, ()):
        assert unit in shown
    if name not in FLEETLESS:
        assert "Fleet file" in shown or "FLEET" in shown


def test_every_option_for_a_fleet_has_the_same_short_form() -> None:
    group: Any = typer.main.get_command(app)
    with_option = set()
    for name in group.list_commands(context := typer.Context(group)):
        for option in group.get_command(context, name).params:
            if "--fleet" in option.opts:
                assert "-f" in option.opts, name
                with_option.add(name)
    assert {"demo", "land", "calibrate", "identify", "inject", "fly", "ground", "logs"} <= with_option


def test_doctor_without_an_argument_examines_the_trio_where_no_fleet_is_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    examined: list[str] = []
    monkeypatch.setattr(
        "rcopterx.commands.hosts.report_findings", lambda file, _host: examined.append(file.name)
    )
    assert run("doctor").exit_code == 0
    assert examined == ["trio"]


def test_manoeuvres_are_listed() -> None:
    result = run("fly", "--list")
    assert result.exit_code == 0
    assert set(MANOEUVRES) <= {line.split()[0] for line in result.output.splitlines()}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("hover",), "No such command 'hover'"),
        (("fly", "loop"), "unknown manoeuvre 'loop', known are paper-formation"),
        (("fly",), "name a manoeuvre"),
        (("goto", "h1", "0", "0"), "Missing argument 'Z'"),
        (("goto", "h1", "a", "0", "1"), "Invalid value for 'x'"),
        (("takeoff", "--height", "0"), "--height"),
        (("takeoff", "--height", "high"), "Invalid value for '--height'"),
        (("demo", "--seconds", "0"), "--seconds"),
        (("follow", "h2", "h1", "--frame", "body"), "unknown frame 'body', known are inertial, heading"),
        (("arm", "--colour", "red"), "No such option"),
        (("agent",), "Missing argument 'VEHICLE'"),
        (("trajectory", "h1", "circle", "tour.csv"), "only waypoints need a file"),
        (("trajectory", "h1", "circle", "--end-radius", "1"), "are only for a spiral"),
        (("trajectory", "h1", "waypoints", "tour.csv", "--climb", "1"), "are only for a spiral"),
        (("replay", "--with", "horizon=30"), "needs --agent"),
        (("flights", "--check", "a", "--digest", "b"), "give one of them"),
        (("certs", "trio", "--days", "1e9"), "--days"),
        (("disarm",), "name the vehicles, or give --all"),
        (("disarm", "h1", "--all"), "name the vehicles, or give --all"),
    ],
)
def test_wrong_arguments_are_usage_errors_that_say_what_is_allowed(
    arguments: tuple[str, ...], words: str
) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert words.lower() in plain(result).lower()


@pytest.mark.parametrize(
    "arguments",
    [
        ("arm",),
        ("disarm", "--all"),
        ("takeoff",),
        ("goto", "h1", "0", "0", "1"),
        ("follow", "h2", "h1"),
        ("lead", "h1"),
        ("land",),
        ("reset",),
        ("fly", "hover"),
    ],
)
def test_a_fleet_that_is_not_up_is_said_so(
    arguments: tuple[str, ...], down: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.ground_station.scripting.fleet.Fleet", quick_fleet())
    result = run(*arguments, "--fleet", down)
    assert result.exit_code == 1
    assert "error: no router at" in result.stderr
    assert f"is the fleet up? (rcopterx up {down})" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def quick_fleet() -> Callable[..., object]:
    """The fleet, with less patience."""
    return lambda file, host, _: Fleet(file, host, timeout_s=0.05)


@pytest.mark.parametrize("command", ["up", "demo", "land", "router", "agent"])
def test_a_fleet_file_that_is_not_there_is_said_so(command: str) -> None:
    options = {"up": ["nowhere.toml"], "agent": ["h1", "-f", "nowhere.toml"]}
    result = run(command, *options.get(command, ["-f", "nowhere.toml"]))
    assert result.exit_code == 2
    assert "error: nowhere.toml: no such file; shipped fleets are" in result.stderr
    assert "trio" in result.stderr


BAD_FILES = [
    ("x = [", "not TOML"),
    (PAIR + "control = { horizon = 1.5 }", "vehicles.h2.control.horizon: expected `int`"),
    (PAIR + 'colour = "red"', "unknown field `colour`, allowed are transmitter, "),
    (PAIR.replace("vehicles.h2", "vehicles.H2"), "vehicles.H2: expected `str` matching regex"),
    (PAIR + "[vehicles.h1]", "not TOML"),
    (PAIR.replace("heli2", "heli1"), "vehicles.h2.subject: 'heli1' is already that of vehicles.h1"),
    (PAIR.replace('leader = "h1"', 'leader = "h7"'), "vehicles.h2.follow[0].leader: unknown vehicle 'h7'"),
    (PAIR.replace('leader = "h1"', 'leader = "h2"'), "vehicles.h2.follow[0].leader: h2 cannot follow itself"),
    (
        PAIR + 'type = "plane"',
        "vehicles.h2.type: unknown type 'plane', allowed are ardupilot_quadrotor, betaflight, ",
    ),
    (HARDWARE_PAIR.replace("radio-h1", "/dev/ttyNONE9"), "vehicles.h1.transmitter.port: there is no device"),
]


@pytest.mark.parametrize(("text", "words"), BAD_FILES)
@pytest.mark.parametrize("command", ["up", "demo", "fly"])
def test_a_wrong_fleet_file_is_a_usage_error_that_names_the_field_and_starts_nothing(
    command: str, text: str, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(text if "x = [" in text else text + f"\n[hosts.main]\nrouter_port = {free()}\n")
    arguments = {"up": [str(path)], "demo": ["-f", str(path)], "fly": ["hover", "--up", "-f", str(path)]}
    result = run(command, *arguments[command])
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")
    assert words in result.stderr
    assert list((tmp_path / "run").rglob("*.log")) == []


def free() -> str:
    return own_address().endpoints[0].rpartition(":")[2]


def test_negative_coordinates_need_no_dashes_and_misspelt_options_are_still_refused(
    up: str, vehicles: Vehicles
) -> None:
    assert run("goto", "--fleet", up, "h1", "--", "-0.5", "-.2", "1").exit_code == 0
    result = run("goto", "h1", "-0.5", "0", "1", "--flet", "x")
    assert result.exit_code == 2
    assert len(vehicles["h1"].requests) == 1


def test_an_address_in_use_is_a_usage_error_that_names_it(tmp_path: Path) -> None:
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        path = tmp_path / "lab.toml"
        path.write_text(PAIR + f"[hosts.main]\nrouter_port = {port}\n")
        result = run("up", str(path))
    assert result.exit_code == 2
    assert f"hosts.main.router_port: 127.0.0.1:{port} cannot be used" in result.stderr
    assert "is the fleet already up?" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("agent", "h9"), "agent: unknown unit 'h9', known are h1, h2"),
        (("transmitters", "roof"), "transmitters: unknown unit 'roof', known are transmitters"),
        (("router", "roof"), "router: unknown unit 'roof', known are main"),
        (("simulator",), "simulator: this fleet flies hardware"),
    ],
)
def test_a_role_that_does_not_exist_is_a_usage_error(
    arguments: tuple[str, ...], words: str, down: str
) -> None:
    result = run(*arguments, "--fleet", down)
    assert result.exit_code == 2
    assert words in result.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("arm", "h9"),
        ("disarm", "h1", "h9"),
        ("takeoff", "h9"),
        ("goto", "h9", "0", "0", "1"),
        ("follow", "h1", "h9"),
        ("lead", "h9"),
        ("land", "h9"),
        ("reset", "h9"),
    ],
)
def test_unknown_vehicles_are_usage_errors_and_nobody_is_asked_anything(
    arguments: tuple[str, ...], up: str, vehicles: Vehicles
) -> None:
    result = run(*arguments, "--fleet", up)
    assert result.exit_code == 2
    assert "unknown vehicle 'h9', known are h1, h2" in plain(result)
    assert vehicles["h1"].requests == vehicles["h2"].requests == []


def test_vehicles_take_off_fly_and_land_by_commands(up: str, vehicles: Vehicles) -> None:
    assert run("takeoff", "--height", "0.7", "--fleet", up).output.strip() == "flying"
    assert vehicles["h2"].requests[-1] == TakeOff(height_m=0.7)
    result = run("goto", "h1", "-0.5", "0", "1", "540", "--fleet", up)
    assert result.exit_code == 0, result.output
    assert result.output.strip() == "h1: on the way to -0.5 0 1 m, 540 deg"
    go_to = vehicles["h1"].requests[-1]
    assert isinstance(go_to, GoTo)
    assert go_to.set_point.position_m == (-0.5, 0.0, 1.0)
    assert go_to.set_point.yaw_rad == pytest.approx(3 * math.pi)
    result = run("follow", "h2", "h1", "--offset=-0.4,0.5,0", "--yaw", "90", "--frame", "heading", "-f", up)
    assert result.output.strip() == "h2 follows h1"
    follow = vehicles["h2"].requests[-1]
    assert isinstance(follow, Follow)
    (link,) = follow.following
    assert (link.offset_m, link.frame) == ((-0.4, 0.5, 0.0), "heading")
    assert link.yaw_offset_rad == pytest.approx(math.pi / 2)
    assert run("lead", "h2", "-f", up).output.strip() == "h2: leads"
    assert run("land", "h2", "-f", up).output.strip() == "landed"
    assert (vehicles["h1"].phase, vehicles["h2"].phase) == ("flying", "ground")


def test_landing_at_once_after_joining_lands_what_has_not_spoken_yet(up: str, vehicles: Vehicles) -> None:
    for vehicle in vehicles.values():
        vehicle.phase, vehicle.state = "flying", "armed"
    assert run("land", "-f", up).output.strip() == "landed"
    assert [vehicle.verbs for vehicle in vehicles.values()] == [["Land", "Disarm"]] * 2


def test_a_vehicle_whose_agent_is_gone_is_not_said_to_have_landed(
    up: str, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.ground_station.scripting.vehicle.ANSWER_S", 1.0)
    vehicles["h1"].speaks = False
    vehicles["h1"].silent.add("land")
    result = run("land", "-f", up)
    assert result.exit_code == 1
    assert "h1 did not answer land" in result.stderr


def test_arm_disarm_kill_and_reset_reach_the_transmitters(up: str, vehicles: Vehicles) -> None:
    assert run("arm", "h1", "-f", up).output.strip() == "armed"
    assert run("disarm", "--all", "-f", up).output.strip() == "disarmed"
    assert run("reset", "h2", "-f", up).output.strip() == "reset"
    assert vehicles["h1"].verbs == ["Arm", "Disarm"]
    assert vehicles["h2"].verbs == ["Disarm", "ResetKill"]


def test_vehicles_in_the_air_are_not_disarmed(up: str, vehicles: Vehicles) -> None:
    vehicles["h2"].phase, vehicles["h2"].state = "flying", "armed"
    wait_for(lambda: "h2: flying" in run("status", "-f", up).output, "not seen to fly")
    result = run("disarm", "--all", "-f", up)
    assert result.exit_code == 1
    assert result.stderr == "error: h2 in the air: land first; only kill cuts the motors\n"
    assert [vehicle.verbs for vehicle in vehicles.values()] == [[], []]


def test_a_refusal_is_an_error_line_with_vehicle_and_reason(up: str, vehicles: Vehicles) -> None:
    vehicles["h1"].refusals["go_to"] = "x: 9 m is outside the flight volume"
    result = run("goto", "h1", "9", "0", "1", "-f", up)
    assert result.exit_code == 1
    assert result.stderr == "error: h1: x: 9 m is outside the flight volume\n"


def test_a_vehicle_that_is_not_ready_is_an_error_line_with_the_reason(up: str, vehicles: Vehicles) -> None:
    vehicles["h1"].ready = False
    result = run("arm", "h1", "-f", up)
    assert result.exit_code == 1
    assert "h1: transmitter not ready: module speaks" in result.stderr


@pytest.mark.parametrize("offset", ["1,2", "a,b,c", "1;2;3", ""])
def test_an_offset_is_three_numbers(up: str, offset: str, vehicles: Vehicles) -> None:
    result = run("follow", "h2", "h1", f"--offset={offset}", "-f", up)
    assert result.exit_code == 2
    assert "three numbers separated by commas" in plain(result)
    assert vehicles["h2"].requests == []


def test_numbers_that_are_not_finite_are_refused_by_the_vehicle(up: str, vehicles: Vehicles) -> None:
    result = run("goto", "h1", "nan", "0", "1", "-f", up)
    assert result.exit_code == 1
    assert "h1 did not answer go_to: go_to: Expected `float`" in result.stderr
    assert vehicles["h1"].requests == []


def test_shipped_fleets_are_valid_and_found_by_name_and_by_path_of_the_source_tree() -> None:
    shipped = shipped_fleets()
    assert "trio" in shipped
    for name, path in shipped.items():
        assert load_fleet(path).vehicles
        assert fleet_path(name) == path
    assert fleet_path("fleet/fleets/trio.toml").stem == "trio"
    with pytest.raises(FleetError, match="no such file; shipped fleets are"):
        fleet_path("deploy/quartet.toml")


def test_a_shipped_fleet_is_found_in_any_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert fleet_path("fleet/fleets/trio.toml") == shipped_fleets()["trio"]
    (tmp_path / "trio").write_text("mine")
    assert fleet_path("trio") == Path("trio")


def test_the_host_is_the_only_one_or_has_to_be_named(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(PAIR)
    fleet = load_fleet(path)
    assert chosen_host(fleet, None) == "main"
    with pytest.raises(FleetError, match="--host: unknown host 'roof', known are main"):
        chosen_host(fleet, "roof")
    port = f"router_port = {free_port()}\n"
    path.write_text(f'{PAIR}[hosts.main]\n{port}[hosts.second]\naddress = "127.0.0.2"\n{port}')
    fleet = load_fleet(path)
    with pytest.raises(FleetError, match="--host: this fleet has several, name one of main, second"):
        chosen_host(fleet, None)
    assert chosen_host(fleet, "second") == "second"
    result = run("up", str(path))
    assert result.exit_code == 2
    assert "--host" in result.stderr
