"""Promises of the commands about flight logs: what there is, in words and as JSON, and mending."""

import json
from itertools import islice
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.flights.flight_writing import FLEET_ATTACHMENT, FlightSettings, FlightWriter
from rcopterx.flights.flights import part_path
from rcopterx.flights.mcap_reading import contents_of, messages_of
from rcopterx.flights.mcap_writing import LoggedMessage, McapFile

FLIGHT = "lab-20261122-141500"
REFERENCE = Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap"


@pytest.fixture
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RCOPTERX_FLIGHTS", str(tmp_path))
    settings = FlightSettings(
        tmp_path, FLIGHT, {"fleet": "lab", "started": "2026-11-22T14:15:00"},
        b'{"vehicles": {"h1": {}, "h2": {}}}', 10**9, 10**10,
    )  # fmt: skip
    writer = FlightWriter(settings)
    writer.write([LoggedMessage("h1/pose", b"x", 1, 1)])
    return tmp_path


def test_flights_are_listed_for_people_and_for_programs(directory: Path) -> None:
    shown = CliRunner().invoke(app, ["flights"]).stdout
    for word in (FLIGHT, "h1 h2", "open or cut off"):
        assert word in shown
    (flight,) = json.loads(CliRunner().invoke(app, ["flights", "--json"]).stdout)
    assert flight["vehicles"] == ["h1", "h2"]
    assert flight["complete"] is False
    assert flight["started"] == "2026-11-22T14:15:00"


def test_no_flights_are_said_with_where_they_were_looked_for(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["flights"], env={"RCOPTERX_FLIGHTS": str(tmp_path)})
    assert result.exit_code == 0
    assert f"no flights in {tmp_path}" in result.output


def test_a_cut_off_file_is_mended_beside_the_old_one_and_a_complete_one_left_alone(directory: Path) -> None:
    path = part_path(directory, FLIGHT, 0)
    before, mended = path.read_bytes(), path.with_name(f"{FLIGHT}.000.recovered.mcap")
    assert not contents_of(path).complete
    result = CliRunner().invoke(app, ["recover", str(path)])
    assert (result.exit_code, result.stdout) == (0, f"{mended}: 1 messages\n")
    assert path.read_bytes() == before
    assert contents_of(mended).complete
    assert "nothing to repair" in CliRunner().invoke(app, ["recover", str(mended)]).stdout
    assert sorted(file.name for file in directory.iterdir()) == [path.name, mended.name]


@pytest.fixture(scope="module")
def damaged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The reference flight in chunks, with 4 KiB of zeros in its middle."""
    path = tmp_path_factory.mktemp("damaged") / "lab-20261122-141500-1.000.mcap"
    contents, messages = contents_of(REFERENCE), messages_of(REFERENCE)
    with path.open("wb") as file:
        mcap = McapFile(file)
        mcap.add_attachment(FLEET_ATTACHMENT, contents.attachments[FLEET_ATTACHMENT], 1)
        while chunk := list(islice(messages, 50)):
            mcap.add_chunk(chunk)
        mcap.finish()
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 4096] = bytes(4096)
    path.write_bytes(data)
    return path


def test_a_damaged_file_is_recovered_beside_it_and_what_is_missing_is_said(damaged: Path) -> None:
    before = damaged.read_bytes()
    result = CliRunner().invoke(app, ["recover", str(damaged)])
    assert result.exit_code == 1
    assert "missing: bytes" in result.stderr
    assert "messages are missing" in result.stderr
    assert damaged.read_bytes() == before
    mended = damaged.with_name("lab-20261122-141500-1.000.recovered.mcap")
    kept, whole = (sum(1 for _ in messages_of(path)) for path in (mended, REFERENCE))
    assert 0.8 * whole < kept < whole
    mended.unlink()


@pytest.mark.parametrize(
    ("arguments", "exit_code"),
    [(["flights", "--check"], 1), (["flights", "--digest"], 0),
     (["export", "-o", "tables"], 0), (["replay", "--agent", "h1"], 1)],
)  # fmt: skip
def test_what_reads_a_damaged_log_says_that_it_is_incomplete(
    damaged: Path, arguments: list[str], exit_code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    command, *options = arguments
    flight = [*options, str(damaged)] if command == "flights" else [str(damaged), *options]
    result = CliRunner().invoke(app, [command, *flight])
    assert "is incomplete: lab-20261122-141500-1.000.mcap: bytes" in result.stderr
    assert result.exit_code == exit_code


def test_flights_that_lack_something_are_listed_as_such(damaged: Path) -> None:
    shown = CliRunner().invoke(app, ["flights"], env={"RCOPTERX_FLIGHTS": str(damaged.parent)}).stdout
    assert "damaged" in shown


def test_what_cannot_be_mended_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"PK")
    result = CliRunner().invoke(app, ["recover", str(tmp_path / "a.mcap")])
    assert result.exit_code == 1
    assert "not an MCAP file" in result.output
