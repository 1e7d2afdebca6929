"""Export of a flight log as CSV files: a table for every unit and channel, a row for every message."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import Any, Final

import msgpack
import msgspec

from rcopterx.bus import channels
from rcopterx.bus.clock import NANO
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.flights.mcap_reading import messages_of
from rcopterx.flights.mcap_writing import LoggedMessage

TIME: Final = "time_s"  # wall clock of arrival at the recorder, seconds since 1970
PLACES: Final = ("x_m", "y_m", "z_m", "yaw_rad")  # first columns of a trajectory
FOR_REPLAYS: Final = (channels.AGENT_STEPS.topic, channels.CALLS.topic)
LONGEST_LIST: Final = 32  # longer lists are not columns of a table


def export_csv(parts: Sequence[Path], directory: Path) -> list[Path]:
    """Write the messages of a flight as CSV files, named for instance `h1-pose.csv`, and return their paths.

    Columns are fields, nested ones with dots (`diagnostics.ticks`), items of lists with their number
    (`position_m.0`), places and headings of plans with that of their stage (`trajectory.x_m.0`). Matrices and
    what is never there are left out. Raises `FlightLogError` if the flight cannot be read, or OSError.
    """
    columns: dict[str, dict[str, None]] = {}
    count = 0
    for message in _table_messages(parts):
        columns.setdefault(message.topic, {}).update(dict.fromkeys(flat(message.payload)))
        count += 1
    directory.mkdir(parents=True, exist_ok=True)
    paths = {topic: directory / f"{topic.replace('/', '-')}.csv" for topic in columns}
    with ExitStack() as stack:
        tables = {}
        for topic, path in paths.items():
            file = stack.enter_context(path.open("w", newline="", encoding="utf-8"))
            tables[topic] = csv.DictWriter(file, [TIME, *columns[topic]], restval="")
            tables[topic].writeheader()
        # A flight that is being recorded has grown meanwhile.
        for message in islice(_table_messages(parts), count):
            seconds, nanoseconds = divmod(message.time_ns, NANO)
            # A float has no room for microseconds and the years since 1970 side by side with nanoseconds.
            row = {TIME: f"{seconds}.{nanoseconds:09d}", **flat(message.payload)}
            tables[message.topic].writerow(row)
    return list(paths.values())


def _table_messages(parts: Sequence[Path]) -> Iterator[LoggedMessage]:
    """Yield the messages of a flight in order, without those that only replays need."""
    for path in parts:
        for message in messages_of(path):
            if message.topic.rpartition("/")[2] not in FOR_REPLAYS:
                yield message


def flat(payload: bytes) -> dict[str, Any]:
    """Return the fields of an encoded message by column; none if it is no MessagePack map."""
    try:
        plain = msgpack.unpackb(payload, raw=False)
    except Exception:  # noqa: BLE001 - msgpack raises many types for invalid payloads
        return {}
    return dict(_columns(plain, "")) if isinstance(plain, dict) else {}


def _columns(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    match value:
        case None | "":
            return
        case {"offset": _, "scale": _, "data": bytes()}:
            yield from _stages(value, name)
        case {"shape": _, "data": bytes()}:
            return
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


def _stages(value: object, name: str) -> Iterator[tuple[str, float]]:
    """Yield place and heading of every stage of a trajectory; nothing if it is malformed."""
    try:
        samples = msgspec.convert(value, TrajectoryArray).to_numpy()
    except ValueError:
        return
    for column, place in enumerate(PLACES):
        for stage, number in enumerate(samples[:, column].tolist()):
            yield f"{name}.{place}.{stage}", round(number, 5)
