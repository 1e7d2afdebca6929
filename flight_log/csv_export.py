"""Writes a flight log as tables: a CSV file for every unit and channel, a row for every message."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import msgpack

from rcopterx.bus import channels
from rcopterx.flight_log.mcap_reading import messages_of
from rcopterx.flight_log.mcap_writing import LoggedMessage

TIME: Final = "time_s"
"""Wall clock of arrival at the recorder, seconds since 1970."""
LONGEST_LIST: Final = 32
"""Longer lists are no columns of a table."""
LEFT_OUT: Final = (channels.AGENT_STEPS.topic,)
"""For replays, not for people."""
NANO: Final = 1_000_000_000


def export_csv(parts: Sequence[Path], directory: Path) -> list[Path]:
    """Write the messages of a flight as CSV files, named for instance `h1-pose.csv`.

    Parameters
    ----------
    parts
        Files of the flight in order.
    directory
        Where the tables go, created if missing; tables of the same names are replaced.

    Returns
    -------
    list of Path
        The tables. Their columns are the fields of the messages, nested ones with dots
        (`diagnostics.ticks`), items of lists with their number (`position_m.0`). Matrices are left out.

    Raises
    ------
    FlightLogError
        The flight cannot be read.
    OSError
        A table cannot be written.
    """
    columns: dict[str, dict[str, None]] = {}
    for message in _messages(parts):
        columns.setdefault(message.topic, {}).update(dict.fromkeys(flat(message.payload)))
    directory.mkdir(parents=True, exist_ok=True)
    paths = {topic: directory / f"{topic.replace('/', '-')}.csv" for topic in columns}
    with ExitStack() as stack:
        tables = {}
        for topic, path in paths.items():
            file = stack.enter_context(path.open("w", newline="", encoding="utf-8"))
            tables[topic] = csv.DictWriter(file, [TIME, *columns[topic]], restval="")
            tables[topic].writeheader()
        for message in _messages(parts):
            seconds, nanoseconds = divmod(message.time_ns, NANO)
            # A float has no room for microseconds and the years since 1970 side by side with nanoseconds.
            row = {TIME: f"{seconds}.{nanoseconds:09d}", **flat(message.payload)}
            tables[message.topic].writerow(row)
    return list(paths.values())


def _messages(parts: Sequence[Path]) -> Iterator[LoggedMessage]:
    for path in parts:
        for message in messages_of(path):
            if message.topic.rpartition("/")[2] not in LEFT_OUT:
                yield message


def flat(payload: bytes) -> dict[str, Any]:
    """Fields of an encoded message by column; none of one that is no MessagePack map."""
    try:
        plain = msgpack.unpackb(payload, raw=False)
    except Exception:  # noqa: BLE001 - msgpack raises many types; anybody can put anything on the bus
        return {}
    return dict(_columns(plain, "")) if isinstance(plain, dict) else {}


def _columns(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    match value:
        case Mapping():
            for key, item in value.items():
                yield from _columns(item, f"{name}.{key}" if name else str(key))
        case list():
            if len(value) <= LONGEST_LIST:
                for number, item in enumerate(value):
                    yield from _columns(item, f"{name}.{number}")
        case bytes():
            return
        case _:
            yield name, value
