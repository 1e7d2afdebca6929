"""Messages of a flight log as rows of tables: a table for every unit and channel."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import msgpack

from rcopterx.bus import channels
from rcopterx.flights.mcap_reading import messages_of
from rcopterx.flights.mcap_writing import LoggedMessage

LONGEST_LIST: Final = 32
"""Longer lists are not columns of a table."""
LEFT_OUT: Final = (channels.AGENT_STEPS.topic,)
"""Only for replays."""
Columns = dict[str, set[type]]
"""Types of the values by column, in the order in which columns appear."""


def table_messages(parts: Sequence[Path]) -> Iterator[LoggedMessage]:
    """Yield the messages of a flight that are rows of tables, in order."""
    for path in parts:
        for message in messages_of(path):
            if message.topic.rpartition("/")[2] not in LEFT_OUT:
                yield message


def columns_of(parts: Sequence[Path]) -> dict[str, Columns]:
    """Return the columns of every table of a flight, by unit and channel (`h1/pose`)."""
    found: dict[str, Columns] = {}
    for message in table_messages(parts):
        columns = found.setdefault(message.topic, {})
        for name, value in flat(message.payload).items():
            columns.setdefault(name, set()).add(type(value))
    return found


def file_name(topic: str, suffix: str) -> str:
    """Return the file name of a table, for instance `h1-pose.csv`."""
    return f"{topic.replace('/', '-')}.{suffix}"


def flat(payload: bytes) -> dict[str, Any]:
    """Return the fields of an encoded message by column; none if it is no MessagePack map."""
    try:
        plain = msgpack.unpackb(payload, raw=False)
    except Exception:  # noqa: BLE001 - msgpack raises many types for invalid payloads
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
