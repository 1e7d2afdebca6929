"""Export of a flight log as Parquet files, for pandas, polars, DuckDB and MATLAB; tables are as in CSV."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
from pyarrow.parquet import ParquetWriter

from rcopterx.flights.tables import Columns, columns_of, file_name, flat, table_messages

TIME: Final = "time"
"""Wall clock of arrival at the recorder, UTC, to the nanosecond."""
ROWS: Final = 10_000
"""Rows of a group, and largest number of rows of a table in memory."""


def export_parquet(parts: Sequence[Path], directory: Path) -> list[Path]:
    """Write the messages of a flight as Parquet files, for instance `h1-pose.parquet`; return their paths.

    Columns and errors are those of `csv_export.export_csv`, except for `time`, a time stamp. Columns of
    integers and floats are 64-bit floats, columns of other mixed types are texts.
    """
    directory.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        tables = {
            topic: stack.enter_context(_Table(directory / file_name(topic, "parquet"), columns))
            for topic, columns in columns_of(parts).items()
        }
        for message in table_messages(parts):
            tables[message.topic].add(message.time_ns, flat(message.payload))
    return [table.path for table in tables.values()]


class _Table:
    """One file under construction."""

    def __init__(self, path: Path, columns: Columns) -> None:
        self.path = path
        fields = [(name, _type_of(kinds)) for name, kinds in columns.items()]
        self._schema = pa.schema([(TIME, pa.timestamp("ns", "UTC")), *fields])
        self._texts = {name for name, kind in fields if kind == pa.string()}
        self._rows: list[dict[str, Any]] = []
        self._writer = ParquetWriter(path, self._schema, compression="zstd")

    def __enter__(self) -> "_Table":
        return self

    def __exit__(self, *_: object) -> None:
        self._flush()
        self._writer.close()

    def add(self, time_ns: int, values: dict[str, Any]) -> None:
        row = {
            name: str(value) if name in self._texts and value is not None else value
            for name, value in values.items()
        }
        self._rows.append({TIME: time_ns, **row})
        if len(self._rows) >= ROWS:
            self._flush()

    def _flush(self) -> None:
        if self._rows:
            self._writer.write_table(pa.Table.from_pylist(self._rows, schema=self._schema))
            self._rows.clear()


def _type_of(kinds: set[type]) -> pa.DataType:
    """Type of a column with values of these Python types."""
    known = kinds - {type(None)}
    if known == {bool}:
        return pa.bool_()
    if known == {int}:
        return pa.int64()
    if known and known <= {int, float}:
        return pa.float64()
    return pa.string()
