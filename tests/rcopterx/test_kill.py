"""Promises of `rcopterx kill`: all that is up is cut at once, and confirmed for every vehicle."""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import msgpack
import pytest
from click.testing import Result
from support.bus import own_address
from support.scripted import ScriptedVehicle, fleet_file_text
from support.waiting import PatientClock
from typer.testing import CliRunner

import rcopterx.kill
from rcopterx.bus import channels
from rcopterx.bus.codec import decode
from rcopterx.bus.messages import Kill
from rcopterx.bus.session import BusAddress
from rcopterx.command_line import app
from rcopterx.deploy.hosts.running import RunningFleet, recorded
from rcopterx.kill import KillVerdict, kill, parsed, report, run

Vehicles = dict[str, ScriptedVehicle]
READING_S = 0.02


@pytest.fixture(autouse=True)
def _unhurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Vehicles confirm in this process; when it stalls, none is late."""
    clock = SimpleNamespace(monotonic=PatientClock(READING_S), sleep=time.sleep)
    monkeypatch.setattr(rcopterx.kill, "time", clock)


def record(address: BusAddress, fleet: str = "lab") -> RunningFleet:
    return RunningFleet(fleet, "0", address.namespace, "main", list(address.endpoints), [], ["h1", "h2"], "")


@pytest.fixture
def running(bus_address: BusAddress, vehicles: Vehicles, tmp_path: Path) -> "Callable[[], object]":
    """The record of the scripted fleet, where `kill` looks for it."""
    directory = tmp_path / "run" / "lab"
    directory.mkdir(parents=True)
    return lambda: recorded(directory, record(bus_address))


def test_the_fleet_that_is_up_is_cut_without_naming_it(
    running: Callable[[], object], vehicles: Vehicles, capsys: pytest.CaptureFixture[str]
) -> None:
    with running():  # type: ignore[attr-defined]
        assert run([], None) == 0
    assert capsys.readouterr().out == "lab: h1 killed\nlab: h2 killed\n"
    assert [vehicle.state for vehicle in vehicles.values()] == ["killed", "killed"]


def test_a_vehicle_that_does_not_obey_is_told_with_its_state_and_the_exit_code(
    running: Callable[[], object],
    vehicles: Vehicles,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rcopterx.kill, "CONFIRM_S", 0.5)
    vehicles["h2"].stuck.add("kill")
    with running():  # type: ignore[attr-defined]
        assert run([], None) == 1
    told = capsys.readouterr()
    assert told.out == "lab: h1 killed\n"
    assert told.err == "error: lab: h2 not killed: its arbiter is DISARMED\n"


def test_single_vehicles_are_cut_and_unknown_names_are_errors_that_stop_nothing(
    running: Callable[[], object], vehicles: Vehicles, capsys: pytest.CaptureFixture[str]
) -> None:
    with running():  # type: ignore[attr-defined]
        assert run(["h2", "h9"], None) == 1
    told = capsys.readouterr()
    assert (told.out, told.err) == ("lab: h2 killed\n", "error: h9 is no vehicle of lab\n")
    assert [vehicle.state for vehicle in vehicles.values()] == ["disarmed", "killed"]


def test_a_router_that_no_record_tells_of_is_asked_who_is_there(
    bus_address: BusAddress, vehicles: Vehicles
) -> None:
    unknown = RunningFleet("", "", bus_address.namespace, "", list(bus_address.endpoints), [], [], "")
    assert kill([unknown]) == [KillVerdict("lab", "h1", ""), KillVerdict("lab", "h2", "")]


def test_a_fleet_that_is_named_is_the_only_one_that_obeys(
    bus_address: BusAddress, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rcopterx.kill, "CONFIRM_S", 0.3)
    other = record(bus_address, "attic")
    reason = "its transmitter gateway does not respond"
    assert kill([other], only="attic") == [KillVerdict("attic", name, reason) for name in ("h1", "h2")]
    assert [vehicle.state for vehicle in vehicles.values()] == ["disarmed", "disarmed"]


def test_a_fleet_that_is_down_is_an_error_for_each_of_its_vehicles(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rcopterx.kill, "CONFIRM_S", 0.3)
    path = tmp_path / "down.toml"
    path.write_text(fleet_file_text(own_address()))
    assert run([], str(path)) == 1
    assert "error: lab: h1 not killed: its transmitter gateway does not respond\n" in capsys.readouterr().err
    assert run([], "nowhere.toml") == 2
    assert "error: nowhere.toml: no such file" in capsys.readouterr().err


def test_a_run_directory_that_cannot_be_created_is_an_error_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "down.toml"
    path.write_text(fleet_file_text(own_address()))
    monkeypatch.setenv("RCOPTERX_RUN", "/proc/x")
    assert run([], str(path)) == 2
    assert capsys.readouterr().err.startswith("error: run directory /proc/x/lab")


def test_without_any_fleet_it_is_said_how_to_name_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([], None) == 1
    assert capsys.readouterr().err.startswith("error: no fleet is up on this computer; name the file")


@pytest.mark.parametrize(
    ("words", "meaning"),
    [
        ([], ([], None)),
        (["h1", "h2"], (["h1", "h2"], None)),
        (["-f", "lab.toml", "h1"], (["h1"], "lab.toml")),
        (["h1", "--fleet", "lab.toml"], (["h1"], "lab.toml")),
        (["--help"], None),
        (["-f"], None),
        (["--fleet=lab.toml"], None),
    ],
)
def test_only_plain_command_lines_go_the_fast_way(words: list[str], meaning: object) -> None:
    assert parsed(words) == meaning


def test_the_command_line_does_the_same_with_what_does_not_go_the_fast_way(tmp_path: Path) -> None:
    result: Result = CliRunner().invoke(app, ["kill", f"--fleet={tmp_path}/nowhere.toml"])
    assert result.exit_code == 2
    assert "nowhere.toml: no such file" in result.stderr


def test_the_bytes_on_the_wire_are_a_valid_kill_on_its_channel(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[tuple[str, bytes]] = []
    monkeypatch.setattr(
        "rcopterx.kill.Router.repeat", lambda self, target, payload: sent.append((target, payload))
    )
    monkeypatch.setattr(rcopterx.kill, "CONFIRM_S", 0.05)
    kill([record(own_address())], ["h2"])
    ((target, payload),) = sent
    assert decode(payload, Kill) == Kill(source="operator", reason="operator", vehicles=("h2",))
    assert target == channels.key(channels.EVERY_FLEET, channels.FLEET_UNIT, channels.KILL.topic)
    assert msgpack.unpackb(payload)["schema_version"] == Kill(source="x", reason="").schema_version


def test_verdicts_become_lines() -> None:
    fleets = [record(own_address())]
    lines = report(
        [KillVerdict("lab", "h1", ""), KillVerdict("lab", "h2", "its arbiter is ARMED")], ["h1"], fleets
    )
    assert lines == ["lab: h1 killed", "error: lab: h2 not killed: its arbiter is ARMED"]


def test_a_kill_imports_no_library_that_takes_long() -> None:
    code = """
import sys
import rcopterx.cli, rcopterx.kill
print(sorted({"numpy", "numba", "scipy", "osqp", "msgspec", "typer", "rich"} & sys.modules.keys()))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.stdout == "[]\n"
