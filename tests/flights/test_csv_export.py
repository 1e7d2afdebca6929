"""Promises of tables of a flight log: a row for every message, a column for every number and text."""

import csv
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgpack
import pytest
from typer.testing import CliRunner

from rcopterx.bus.codec import decode
from rcopterx.bus.messages import Command, Plan
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


def test_plans_are_places_in_metres_stage_by_stage(tables: dict[str, list[dict[str, str]]]) -> None:
    plans = [decode(m.payload, Plan) for m in messages_of(FLIGHT) if m.topic == "h2/plan"]
    for plan, row in zip(plans, tables["h2-plan"], strict=True):
        samples = plan.trajectory.to_numpy()
        for column, name in enumerate(("x_m", "y_m", "z_m", "yaw_rad")):
            places = [float(row[f"trajectory.{name}.{stage}"]) for stage in range(len(samples))]
            assert places == pytest.approx(samples[:, column], abs=1e-5)
    assert not any("scale" in name or "offset.0" in name for name in tables["h2-plan"][0])


def test_no_column_is_empty_or_there_twice(tables: dict[str, list[dict[str, str]]]) -> None:
    for name, rows in tables.items():
        columns = list(rows[0])
        assert [column for column in columns if not any(row[column] for row in rows)] == [], name
        assert [one for one in columns if any(other.startswith(f"{one}.") for other in columns)] == [], name
    for path in tables:
        assert len(set(tables[path][0])) == len(tables[path][0])


def test_the_lines_of_the_page_read_the_plans_of_a_flight(tmp_path: Path) -> None:
    export_csv([FLIGHT], tmp_path / "tables")
    page = (Path(__file__).parents[2] / "docs" / "logs.md").read_text()
    lines = page.partition("```python\n")[2].partition("```")[0]
    assert len([line for line in lines.splitlines() if line]) == 3
    script = f"{lines}\nprint(x_m.shape, y_m.shape, z_m.shape)"
    printed = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout
    assert printed == "(161, 10) (161, 10) (161, 10)\n"


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
    plain = {"a": [1, {"b": 2}], "raw": b"x", "long": [0] * 33, "word": "w"}
    assert flat(msgpack.packb(plain)) == {"a.0": 1, "a.1.b": 2, "word": "w"}
    matrix = {"shape": [1, 1], "data": bytes(8)}
    trajectory = {"offset": [0.0], "scale": [1.0], "data": b"no"}
    assert flat(msgpack.packb({"inputs": matrix, "plan": trajectory, "t": 1.0})) == {"t": 1.0}
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
