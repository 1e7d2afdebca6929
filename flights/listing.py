"""Summaries of flights, and repair of files that were cut off."""

import fcntl
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from rcopterx.flights.flight_writing import FLEET_ATTACHMENT, METADATA
from rcopterx.flights.flights import Flight
from rcopterx.flights.mcap_reading import Contents, FlightLogError, contents_of, messages_of
from rcopterx.flights.mcap_writing import McapFile

CHUNK_MESSAGES: Final = 500


@dataclass(frozen=True)
class FlightSummary:
    """One line of the list of flights; `complete` once it has ended well, `problem` if it is unreadable."""

    name: str
    fleet: str
    started: str
    vehicles: tuple[str, ...]
    size_bytes: int
    files: int
    complete: bool
    commit: str
    directory: str
    problem: str = ""


def summary_of(flight: Flight) -> FlightSummary:
    """Return the summary of a flight, without reading its messages."""
    problem, contents = "", [Contents()]
    vehicles: tuple[str, ...] = ()
    try:
        contents = [contents_of(path) for path in flight.parts]
        vehicles = vehicles_in(contents[0].attachments.get(FLEET_ATTACHMENT, b"{}"))
    except FlightLogError as error:
        problem = str(error)
    metadata = contents[0].metadata.get(METADATA, {})
    return FlightSummary(
        name=flight.name,
        fleet=metadata.get("fleet", ""),
        started=metadata.get("started", ""),
        vehicles=vehicles,
        size_bytes=flight.size_bytes,
        files=len(flight.parts),
        complete=not problem and all(part.complete for part in contents),
        commit=metadata.get("commit", ""),
        directory=str(flight.parts[0].parent),
        problem=problem,
    )


class _Fleet(msgspec.Struct):
    vehicles: dict[str, object] = {}


def vehicles_in(fleet: bytes) -> tuple[str, ...]:
    """Return the vehicles of a snapshot of a fleet file; raises `FlightLogError` if it is none."""
    try:
        return tuple(msgspec.json.decode(fleet, type=_Fleet).vehicles)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise FlightLogError(f"snapshot of the fleet file: {error}") from None


class Mended(NamedTuple):
    """Contents of a mended file."""

    messages: int
    damaged_chunks: int


def mend(path: Path) -> Mended:
    """Replace a file by a complete one with everything readable.

    Raises `FlightLogError` if it is no log, or is being recorded.
    """
    contents, read, count = contents_of(path), Contents(), 0
    _refuse_recorded(path)
    target = path.with_name(path.name + ".new")
    with target.open("wb") as file:
        mcap = McapFile(file)
        for name, table in contents.metadata.items():
            mcap.add_metadata(name, table)
        for name, data in contents.attachments.items():
            mcap.add_attachment(name, data, 0)
        messages = messages_of(path, read)
        while chunk := list(islice(messages, CHUNK_MESSAGES)):
            mcap.add_chunk(chunk)
            count += len(chunk)
        mcap.finish()
    target.replace(path)
    return Mended(count, read.damaged_chunks)


def _refuse_recorded(path: Path) -> None:
    """Raise `FlightLogError` if a recorder writes a file, which it keeps locked."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FlightLogError(f"{path}: is being recorded") from None
        except OSError:  # a file system without locks
            return
