"""Promises of Parquet tables: the rows and columns of the CSV tables, with types and exact times."""

import csv
from pathlib import Path

import pytest

from rcopterx.flights.csv_export import export_csv
from rcopterx.flights.mcap_writing import LoggedMessage, McapFile
from rcopterx.flights.parquet_export import export_parquet

pq = pytest.importorskip("pyarrow.parquet")
FLIGHT = Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap"


def test_parquet_tables_have_the_rows_and_columns_of_the_csv_tables(tmp_path: Path) -> None:
    columns = {}
    for path in export_csv([FLIGHT], tmp_path / "csv"):
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        columns[path.stem] = (rows[0][1:], len(rows) - 1)
    for path in export_parquet([FLIGHT], tmp_path / "parquet"):
        table = pq.read_table(path)
        names, rows = columns.pop(path.stem)
        assert table.column_names == ["time", *names]
        assert table.num_rows == rows
    assert not columns


def test_values_keep_their_types_and_times_their_nanoseconds(tmp_path: Path) -> None:
    log = tmp_path / "x.mcap"
    with log.open("wb") as file:
        mcap = McapFile(file, {})
        # {"a": 1, "b": 1.5, "c": true, "d": "x"} and {"a": 2.5, "b": nil, "d": 3}
        first = b"\x84\xa1a\x01\xa1b\xcb\x3f\xf8\x00\x00\x00\x00\x00\x00\xa1c\xc3\xa1d\xa1x"
        second = b"\x83\xa1a\xcb\x40\x04\x00\x00\x00\x00\x00\x00\xa1b\xc0\xa1d\x03"
        time_ns = 1_700_000_000_123_456_789
        mcap.add_chunk(
            [LoggedMessage("h1/pose", first, time_ns, 1), LoggedMessage("h1/pose", second, time_ns + 1, 2)]
        )
        mcap.finish()
    (path,) = export_parquet([log], tmp_path / "out")
    table = pq.read_table(path)
    assert table["time"].cast("int64").to_pylist() == [time_ns, time_ns + 1]
    assert table["a"].to_pylist() == [1.0, 2.5]
    assert table["b"].to_pylist() == [1.5, None]
    assert table["c"].to_pylist() == [True, None]
    assert table["d"].to_pylist() == ["x", "3"]
