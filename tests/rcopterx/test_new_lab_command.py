"""Promises of `rcopterx new-lab`: it offers what it finds, writes what can fly, and overwrites nothing."""

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import Result
from hypothesis import given
from hypothesis import strategies as st
from support.tracker import running_tracker
from support.waiting import DEADLINE_S
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.deploy.new_laboratory import NewLaboratory, NewVehicle, fleet_file_text
from rcopterx.fleet.reading import load_fleet, parse_fleet
from rcopterx.transmitter_gateway import adapters
from rcopterx.transmitter_gateway.adapters import Adapter, plugged_in

ROOT = Path(__file__).parents[2]
NO_TRACKER = "vicon\n127.0.0.1:1\n"
TWO = "heli1,heli2\n\n/dev/ttyUSB0\n\n/dev/ttyUSB1\n"
VOLUME = "-1,-1,0\n1,1,2\n"
ANSWERS = NO_TRACKER + TWO + VOLUME


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rcopterx.commands.new_lab.LOOK_S", 0.3)


def new_lab(file: Path, answers: str = "") -> Result:
    result = CliRunner().invoke(
        app, ["new-lab", str(file)], input=answers, env={"COLUMNS": "300", "TERM": "dumb"}
    )
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def serial_port(device: str, vid: int | None = 0x0403) -> SimpleNamespace:
    return SimpleNamespace(
        device=device, vid=vid, description="FT232R USB UART", serial_number=None, location=None
    )


@pytest.fixture
def ports(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Let these serial ports be there."""

    def there(*entries: SimpleNamespace) -> None:
        monkeypatch.setattr(adapters.list_ports, "comports", lambda: list(entries))

    return there


def test_subjects_and_adapters_are_offered_and_return_takes_them(
    tmp_path: Path, ports: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.commands.new_lab.LOOK_S", DEADLINE_S)
    ports(serial_port("/dev/ttyUSB1"), serial_port("/dev/ttyUSB0"), serial_port("/dev/ttyS0", vid=None))
    with running_tracker("heli1", "heli2") as server:
        address = f"{server.address[0]}:{server.address[1]}"
        result = new_lab(tmp_path / "lab.toml", answers="\n" + address + "\n" * 8)
    assert result.exit_code == 0, result.output
    for found in ("heli1", "heli2", "/dev/ttyUSB0", "/dev/ttyUSB1", "FT232R"):
        assert found in result.stderr
    assert "ttyS0" not in result.stderr
    fleet = load_fleet(tmp_path / "lab.toml")
    assert fleet.simulator is None
    assert fleet.tracker.address == address
    assert [one.subject for one in fleet.vehicles.values()] == ["heli1", "heli2"]
    assert [one.transmitter.port for one in fleet.vehicles.values()] == ["/dev/ttyUSB0", "/dev/ttyUSB1"]
    assert [one.transmitter.model_match for one in fleet.vehicles.values()] == [1, 2]


def test_a_tracker_that_does_not_answer_is_told_and_names_can_be_typed(
    tmp_path: Path, ports: Callable[..., None]
) -> None:
    ports()
    answers = NO_TRACKER + "heli7\n\n/dev/ttyACM0\n\n\n"
    result = new_lab(tmp_path / "lab.toml", answers=answers)
    assert result.exit_code == 0, result.output
    assert "Connection refused; type the names" in result.stderr
    assert "serial adapters: none" in result.stderr
    fleet = load_fleet(tmp_path / "lab.toml")
    assert (fleet.vehicles["h1"].subject, fleet.vehicles["h1"].transmitter.port) == ("heli7", "/dev/ttyACM0")


def test_an_answer_that_cannot_be_read_is_asked_for_again(tmp_path: Path, ports: Callable[..., None]) -> None:
    ports()
    answers = (
        "optitrak\nvicon\n127.0.0.1\n127.0.0.1:99999\n127.0.0.1:1\n,\nheli7,heli7\nheli7\n"
        "plane\ncoaxial\n/dev/ttyACM0\n-1,-1\n-1500,-1500,0\n-1,-1,0\nwide\n-2,1,2\n1,1,2\n"
    )
    result = new_lab(tmp_path / "lab.toml", answers=answers)
    assert result.exit_code == 0, result.output
    for complaint in (
        "unknown brand 'optitrak', known are vicon, ",
        "did you mean 'optitrack'?",
        "at least one subject is needed",
        "'heli7' is already that of vehicles.h1",
        "unknown type 'plane', allowed are ",
        "-1500 m is more than 100 m: in millimetres?",
        "volume.max_m[0]: -2.0 must be greater than min_m[0] = -1.0",
        "'127.0.0.1', must be HOST:PORT",
        "'127.0.0.1:99999', must be HOST:PORT",
        "'-1,-1': three numbers",
        "'wide': three numbers",
    ):
        assert complaint in result.stderr
    assert load_fleet(tmp_path / "lab.toml").volume.min_m == (-1.0, -1.0, 0.0)


def test_two_crazyflies_with_an_optitrack_in_one_go(tmp_path: Path, ports: Callable[..., None]) -> None:
    ports()
    path = tmp_path / "lab.toml"
    answers = "optitrack\n10.0.0.5:1510\n120\n200\ncf1, cf2\ncrazyflie\n\n\nradio://0/80/2M/E7E7E7E7E7\n\n\n"
    result = new_lab(path, answers=answers)
    assert result.exit_code == 0, result.output
    assert "no whole number of frames of tracker.rate_hz = 120 Hz" in result.stderr
    assert "crazyflie          Crazyflie 2.x with its own firmware" in result.stderr
    assert "optitrack  OptiTrack Motive" in result.stderr
    fleet = load_fleet(path)
    assert (fleet.tracker.brand, fleet.tracker.address) == ("optitrack", "10.0.0.5:1510")
    assert fleet.tracker.rate_hz == 200.0
    assert [one.type for one in fleet.vehicles.values()] == ["crazyflie", "crazyflie"]
    assert [one.transmitter.port for one in fleet.vehicles.values()] == [
        "radio://0/80/2M/E7E7E7E701",
        "radio://0/80/2M/E7E7E7E7E7",
    ]
    steps = result.stdout.split("down:\n")[1].splitlines()
    assert [step.strip() for step in steps] == [
        "pip install 'rcopterx[mocap]'",
        "pip install 'rcopterx[crazyflie]'",
        "give every Crazyflie its address: docs/crazyflie.md",
        f"rcopterx up {path}",
        "rcopterx check",
    ]
    assert all(f"#     {step.strip()}\n" in path.read_text(encoding="utf-8") for step in steps)


def test_types_may_differ_and_each_has_its_next_steps(tmp_path: Path, ports: Callable[..., None]) -> None:
    ports(serial_port("/dev/ttyUSB0"), serial_port("/dev/ttyUSB1"))
    path = tmp_path / "lab.toml"
    answers = NO_TRACKER + "cf,a,b\ncrazyflie\nUSB0\nradio://0/80/2M\n\ncoaxial\n\n\n\n" + VOLUME
    result = new_lab(path, answers=answers)
    assert result.exit_code == 0, result.output
    fleet = load_fleet(path)
    assert [one.type for one in fleet.vehicles.values()] == ["crazyflie", "coaxial", "coaxial"]
    assert [one.transmitter.port for one in fleet.vehicles.values()][1:] == ["/dev/ttyUSB0", "/dev/ttyUSB1"]
    assert f"rcopterx bind h2 -f {path}" in result.stdout
    assert "bind h1" not in result.stdout
    assert "bind h3" not in result.stdout


def test_an_editor_finds_the_schema_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    new_lab(path, answers=ANSWERS)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    documentation = project["urls"]["Documentation"]
    assert path.read_text(encoding="utf-8").splitlines()[0] == f"#:schema {documentation}/fleet.schema.json"
    assert (ROOT / "docs" / "fleet.schema.json").is_file()


def test_the_commands_of_its_first_lines_can_be_copied(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    new_lab(path, answers=ANSWERS)
    assert f"#     rcopterx bind h1 -f {path}\n" in path.read_text(encoding="utf-8")


def test_answers_from_a_pipe_are_enough(tmp_path: Path) -> None:
    result = new_lab(tmp_path / "lab.toml", answers=ANSWERS)
    assert result.exit_code == 0, result.output
    fleet = load_fleet(tmp_path / "lab.toml")
    assert fleet.name == "lab"
    assert (fleet.volume.min_m, fleet.volume.max_m) == ((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0))


def test_what_is_commented_out_makes_a_formation(tmp_path: Path) -> None:
    new_lab(tmp_path / "lab.toml", answers=ANSWERS)
    text = (tmp_path / "lab.toml").read_text(encoding="utf-8")
    fleet = parse_fleet(re.sub(r"^# (follow|low_power)", r"\1", text, flags=re.MULTILINE))
    assert [link.leader for link in fleet.vehicles["h2"].follow] == ["h1"]


def test_a_file_that_is_there_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text("mine")
    result = new_lab(path, answers=ANSWERS)
    assert result.exit_code == 2
    assert "is not overwritten" in result.stderr
    assert path.read_text() == "mine"


@pytest.mark.parametrize(
    ("answers", "reason"),
    [
        (NO_TRACKER + TWO + "1,1,1\n0,0,0\n", "no answer to 'Upper corner"),
        ("optitrack\n\n120\n", "no answer to 'Its rate"),
        (NO_TRACKER + TWO, "no answer to 'Lower corner"),
    ],
)
def test_answers_that_cannot_be_used_are_told_and_nothing_is_written(
    answers: str, reason: str, tmp_path: Path
) -> None:
    result = new_lab(tmp_path / "lab.toml", answers=answers)
    assert result.exit_code == 2, result.output
    assert reason in result.stderr
    assert not (tmp_path / "lab.toml").exists()


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        ("9.toml", "name of the fleet: expected"),
        ("nowhere/lab.toml", "nowhere: no such directory"),
    ],
)
def test_what_no_answer_changes_is_refused_before_the_first_question(
    file: str, reason: str, tmp_path: Path
) -> None:
    result = new_lab(tmp_path / file)
    assert result.exit_code == 2, result.output
    assert reason in result.stderr
    assert "Tracker" not in result.stderr


@given(st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1))
def test_any_name_of_a_subject_survives_the_file(subject: str) -> None:
    corners = ((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0))
    vehicles = [NewVehicle("h1", subject, "/dev/ttyUSB0", "coaxial")]
    text = fleet_file_text(NewLaboratory("lab", "10.0.0.1:801", *corners, vehicles), Path("lab.toml"))
    assert parse_fleet(text).vehicles["h1"].subject == subject


def test_an_adapter_is_named_by_its_serial_number_where_there_is_a_link(
    tmp_path: Path, ports: Callable[..., None]
) -> None:
    device, link = tmp_path / "ttyUSB0", tmp_path / "names" / "A1B2"
    device.touch()
    link.parent.mkdir()
    link.symlink_to(device)
    ports(serial_port(str(device)))
    assert plugged_in((link.parent,)) == [Adapter(str(link), str(device), "FT232R USB UART")]
    assert plugged_in(()) == [Adapter(str(device), str(device), "FT232R USB UART")]
