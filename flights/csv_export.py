"""Export of a flight log as CSV files: a table for every unit and channel, a row for every message."""

import csv
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from rcopterx.flights.tables import columns_of, file_name, flat, table_messages

TIME: Final = "time_s"
"""Wall clock of arrival at the recorder, seconds since 1970."""
NANO: Final = 1_000_000_000


def export_csv(parts: Sequence[Path], directory: Path) -> list[Path]:
    """Write the messages of a flight as CSV files, named for instance `h1-pose.csv`, and return their paths.

    Columns are the fields of the messages, nested ones with dots (`diagnostics.ticks`), items of lists
    with their number (`position_m.0`). Matrices are left out. Files of the same names are replaced. Raises
    `FlightLogError` if the flight cannot be read, OSError if a table cannot be written.
    """
    columns = columns_of(parts)
    directory.mkdir(parents=True, exist_ok=True)
    paths = {topic: directory / file_name(topic, "csv") for topic in columns}
    with ExitStack() as stack:
        tables = {}
        for topic, path in paths.items():
            file = stack.enter_context(path.open("w", newline="", encoding="utf-8"))
            tables[topic] = csv.DictWriter(file, [TIME, *columns[topic]], restval="")
            tables[topic].writeheader()
        for message in table_messages(parts):
            seconds, nanoseconds = divmod(message.time_ns, NANO)
            # A float has no room for microseconds and the years since 1970 side by side with nanoseconds.
            row = {TIME: f"{seconds}.{nanoseconds:09d}", **flat(message.payload)}
            tables[message.topic].writerow(row)
    return list(paths.values())
