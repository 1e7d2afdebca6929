"""Promises of tables of a flight log: a row for every message, a column for every number and text."""

import csv
from collections.abc import Iterator
from pathlib import Path

import msgpack
import pytest
from typer.testing import CliRunner

from rcopterx.bus.codec import decode
from rcopterx.bus.messages import Command
from rcopterx.command_line import app
from rcopterx.flights.csv_export import export_csv, flat
from rcopterx.flights.mcap_reading import messages_of
from rcopterx.flights.mcap_writing import LoggedMessage

FLIGHT = Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap"


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, str]]]:
    directory = tmp_path_factory.mktemp("tables")
    found = {}
    for path in export_csv([FLIGHT], directory):
        with path.open(newline="", encoding="utf-8") as file:
            found[path.stem] = list(csv.DictReader(file))
    return found


def test_every_message_is_a_row_with_its_time_and_numbers_to_the_last_digit(
    tables: dict[str, list[dict[str, str]]],
) -> None:
    messages = [m for m in messages_of(FLIGHT) if m.topic == "h2/command"]
    rows = tables["h2-command"]
    assert len(rows) == len(messages)
    for message, row in zip(messages, rows, strict=True):
        command = decode(message.payload, Command)
        assert round(float(row["time_s"]), 3) == round(message.time_ns / 1e9, 3)
        assert row["time_s"].replace(".", "") == str(message.time_ns)
        assert tuple(float(row[f"input.{number}"]) for number in range(4)) == command.input
        assert int(row["sequence"]) == command.sequence


def test_fields_that_come_later_and_nested_ones_have_their_columns(
    tables: dict[str, list[dict[str, str]]],
) -> None:
    statuses = tables["h2-status"]
    assert {"phase", "set_point.position_m.2", "diagnostics.controller"} <= statuses[0].keys()
    assert {row["phase"] for row in statuses} >= {"flying"}
    assert not any(name.endswith("-steps") for name in tables)


def test_a_flight_that_is_being_recorded_is_exported_as_far_as_it_was_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = [LoggedMessage("h1/pose", msgpack.packb({"frame": 1}), 0, 0)]

    def growing(_path: Path) -> Iterator[LoggedMessage]:
        yield from tuple(log)
        log.append(LoggedMessage("h1/pose", msgpack.packb({"later": 1}), 1, 0))
        log.append(LoggedMessage("main/launcher", msgpack.packb({"running": 1}), 2, 0))

    monkeypatch.setattr("rcopterx.flights.csv_export.messages_of", growing)
    (table,) = export_csv([tmp_path / "flight.mcap"], tmp_path)
    assert table.read_text().split() == ["time_s,frame", "0.000000000,1"]


def test_bytes_long_lists_and_what_is_no_message_are_no_columns() -> None:
    plain = {"a": [1, {"b": None}], "raw": b"x", "long": [0] * 33, "word": "w"}
    assert flat(msgpack.packb(plain)) == {"a.0": 1, "a.1.b": None, "word": "w"}
    assert flat(b"\xc1") == flat(msgpack.packb([1])) == {}


def test_the_command_says_where_the_tables_are_and_what_is_wrong(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["export", str(FLIGHT), "-o", str(tmp_path / "out")])
    assert result.exit_code == 0
    assert f"tables in {tmp_path / 'out'}" in result.stdout
    assert (tmp_path / "out" / "h1-pose.csv").exists()
    (tmp_path / "a.mcap").write_bytes(b"PK")
    wrong = CliRunner().invoke(app, ["export", str(tmp_path / "a.mcap"), "-o", str(tmp_path / "no")])
    assert wrong.exit_code == 1
    assert "not an MCAP file" in wrong.output
