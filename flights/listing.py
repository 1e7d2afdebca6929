"""Summaries of flights, and repair of files that were cut off."""

from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from rcopterx.flights.flight_writing import FLEET_ATTACHMENT, METADATA
from rcopterx.flights.flights import SUFFIX, Flight, missing_parts
from rcopterx.flights.mcap_reading import LogContents, contents_of, messages_of
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.flights.mcap_writing import McapFile
from rcopterx.places import is_locked

CHUNK_MESSAGES: Final = 500
RECOVERED: Final = ".recovered.mcap"


@dataclass(frozen=True)
class FlightSummary:
    """One line of the list of flights; `problem` if it is unreadable."""

    name: str
    fleet: str
    started: str
    vehicles: tuple[str, ...]
    size_bytes: int
    files: int
    complete: bool  # it has ended well and every bit of it is right
    damaged: bool  # parts of it are not readable
    commit: str
    directory: str
    problem: str = ""

    @property
    def state(self) -> str:
        """Words about its files."""
        return "complete" if self.complete else "damaged" if self.damaged else "open or cut off"


def summary_of(flight: Flight) -> FlightSummary:
    """Return the summary of a flight, without its messages."""
    problem, contents = "", [LogContents()]
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
        complete=not problem and all(part.complete for part in contents) and not missing_parts(flight),
        damaged=any(part.missing for part in contents),
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
    """Contents of a mended file: where it is, how many messages, and sentences about what is missing."""

    path: Path
    messages: int
    missing: tuple[str, ...]


def mend(path: Path) -> Mended:
    """Write a complete file with everything readable beside a damaged one, which stays as it is.

    Raises `FlightLogError` if it is no log, is being recorded, or has been mended before.
    """
    contents, read, count = contents_of(path), LogContents(), 0
    if is_recorded(path):
        raise FlightLogError(f"{path}: is being recorded")
    target = path.with_name(path.name.removesuffix(SUFFIX) + RECOVERED)
    if target.exists():
        raise FlightLogError(f"{target}: exists already; remove or rename it")
    unfinished = target.with_name(target.name + ".new")
    with unfinished.open("wb") as file:
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
    unfinished.replace(target)
    missing = list(read.missing)
    if FLEET_ATTACHMENT not in read.attachments:
        missing.append("the fleet file is lost")
    if read.nameless:
        missing.append(f"{read.nameless} intact messages are left out: the names of their channels are lost")
    if read.recorded > count:
        missing.append(f"{read.recorded - count} of {read.recorded} messages are missing")
    return Mended(target, count, tuple(missing))


def incomplete(flight: Flight) -> list[str]:
    """Return sentences about what a flight lacks: parts, the end of a part, damaged places."""
    lines = [f"part {number:03d} is missing" for number in missing_parts(flight)]
    for path in flight.parts:
        contents = contents_of(path)
        if not (contents.complete or contents.missing):
            contents.missing.append("the recorder did not finish it")
        if not contents.complete and is_recorded(path):
            contents.missing = ["is being recorded"]
        lines += [f"{path.name}: {words}" for words in contents.missing]
    return lines


def is_recorded(path: Path) -> bool:
    """Return whether a recorder writes a file, which it keeps locked."""
    with path.open("rb") as file, suppress(OSError):  # a file system without locks
        return is_locked(file)
    return False
