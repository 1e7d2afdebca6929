"""Promises of the commands about flight logs: what there is, in words and as JSON, and mending."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.flights.flight_writing import FlightSettings, FlightWriter
from rcopterx.flights.flights import part_path
from rcopterx.flights.mcap_reading import contents_of
from rcopterx.flights.mcap_writing import LoggedMessage

FLIGHT = "lab-20261122-141500"


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


def test_a_cut_off_file_is_mended_in_place_and_a_complete_one_left_alone(directory: Path) -> None:
    path = part_path(directory, FLIGHT, 0)
    assert not contents_of(path).complete
    assert CliRunner().invoke(app, ["recover", str(path)]).stdout == f"{path}: 1 messages\n"
    mended = path.read_bytes()
    assert contents_of(path).complete
    assert "nothing to repair" in CliRunner().invoke(app, ["recover", str(path)]).stdout
    assert path.read_bytes() == mended
    assert [file.name for file in directory.iterdir()] == [path.name]


def test_what_cannot_be_mended_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"PK")
    result = CliRunner().invoke(app, ["recover", str(tmp_path / "a.mcap")])
    assert result.exit_code == 1
    assert "not an MCAP file" in result.output
