"""Writes the files of one flight: part after part, within a limit of disk space, until the disk is full."""

import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from rcopterx.flights.flights import flights_in, next_part, part_path, too_many
from rcopterx.flights.mcap_writing import LoggedMessage, McapFile

METADATA: Final = "flight"
FLEET_ATTACHMENT: Final = "fleet.json"
FREE_BYTES: Final = 64 * 1024 * 1024
"""Left free on the disk for logs, reports and the fleet file."""
CHECK_FREE_CHUNKS: Final = 10
PART_CHUNKS: Final = 20_000
"""A part ends after half an hour at the latest: the index of its chunks is kept in memory."""


@dataclass(frozen=True)
class FlightSettings:
    """Where and how much is recorded.

    Attributes
    ----------
    metadata
        Texts about the flight for every part.
    fleet
        Snapshot of the fleet file.
    schemas
        See `McapFile`.
    part_bytes
        Size from which a part is followed by the next one.
    keep_bytes
        Limit of all flights in the directory; the oldest parts are removed.
    """

    directory: Path
    flight: str
    metadata: Mapping[str, str]
    fleet: bytes
    schemas: Mapping[str, tuple[str, bytes]]
    part_bytes: int
    keep_bytes: int


def open_new(path: Path) -> BinaryIO:
    """Create a file."""
    return path.open("xb", buffering=0)


def free_bytes(directory: Path) -> int:
    """Return the free space of the disk of a directory."""
    return shutil.disk_usage(directory).free


class FlightWriter:
    """Writes chunks of messages; the first failure of the disk ends the recording, see `problem`."""

    def __init__(
        self,
        settings: FlightSettings,
        opener: Callable[[Path], BinaryIO] = open_new,
        free: Callable[[Path], int] = free_bytes,
    ) -> None:
        self._settings = settings
        self._opener = opener
        self._free = free
        self._file: BinaryIO | None = None
        self._mcap: McapFile | None = None
        self._earlier_bytes = 0
        self._chunks = 0
        self.path: Path | None = None
        self.problem = ""
        """Why the recording ended; empty while it works."""

    @property
    def written_bytes(self) -> int:
        """Size of all parts so far."""
        return self._earlier_bytes + (0 if self._mcap is None else self._mcap.written_bytes)

    def write(self, messages: Sequence[LoggedMessage]) -> None:
        """Write messages to the disk."""
        if self.problem or not messages:
            return
        try:
            self._write(messages)
        except OSError as error:
            self._stop(f"{self.path or self._settings.directory}: {error.strerror or error}")

    def _write(self, messages: Sequence[LoggedMessage]) -> None:
        if self._mcap is not None and self._part_is_full(self._mcap):
            self.close()
        mcap = self._begin(messages[0].time_ns) if self._mcap is None else self._mcap
        if self._chunks % CHECK_FREE_CHUNKS == 0 and self._free(self._settings.directory) < FREE_BYTES:
            raise OSError(f"less than {FREE_BYTES // 2**20} MiB are free")
        self._chunks += 1
        mcap.add_chunk(messages)

    def _part_is_full(self, mcap: McapFile) -> bool:
        return mcap.written_bytes >= self._settings.part_bytes or mcap.chunks >= PART_CHUNKS

    def _begin(self, time_ns: int) -> McapFile:
        settings = self._settings
        settings.directory.mkdir(parents=True, exist_ok=True)
        self._make_room()
        number = next_part(settings.directory, settings.flight)
        self.path = part_path(settings.directory, settings.flight, number)
        self._file = self._opener(self.path)
        mcap = self._mcap = McapFile(self._file, settings.schemas)
        mcap.add_metadata(METADATA, {**settings.metadata, "part": str(number)})
        mcap.add_attachment(FLEET_ATTACHMENT, "application/json", settings.fleet, time_ns)
        return mcap

    def _make_room(self) -> None:
        """Remove the oldest parts, those of this flight last, to make room for the next one."""
        settings = self._settings
        flights = flights_in(settings.directory)
        own = [flight for flight in flights if flight.name == settings.flight]
        parts = [path for flight in [*(f for f in flights if f not in own), *own] for path in flight.parts]
        sizes = [(path, path.stat().st_size) for path in parts]
        for path in too_many(sizes, max(0, settings.keep_bytes - settings.part_bytes)):
            path.unlink(missing_ok=True)

    def _stop(self, problem: str) -> None:
        self.problem = problem
        if self._file is not None and self._mcap is not None:
            # What was written of the last chunk would end every reader.
            with suppress(OSError):
                self._file.truncate(self._mcap.written_bytes)
                self._file.seek(self._mcap.written_bytes)
                self._mcap.finish()
            with suppress(OSError):
                self._file.close()
            self._earlier_bytes += self._mcap.written_bytes
        self._file = self._mcap = None

    def close(self) -> None:
        """Complete the present part."""
        if self._mcap is None or self._file is None:
            return
        try:
            self._mcap.finish()
            self._file.close()
        except OSError as error:
            self._stop(f"{self.path}: {error.strerror or error}")
            return
        self._earlier_bytes += self._mcap.written_bytes
        self._file = self._mcap = None
