"""Writes the files of one flight: part after part, within limits of disk space."""

import fcntl
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from rcopterx.flights.flights import Flight, flights_in, next_part, part_path, too_many
from rcopterx.flights.mcap_writing import LoggedMessage, McapFile

METADATA: Final = "flight"
FLEET_ATTACHMENT: Final = "fleet.json"
FREE_BYTES: Final = 64 * 1024 * 1024  # left free on the disk for logs, reports and the fleet file
KEPT_FLIGHTS: Final = 5  # newest earlier flights of a fleet that are kept on an almost full disk
CHECK_FREE_WRITES: Final = 10
RETRY_WRITES: Final = 50  # after a failure, every so many writes, about 5 s, the disk is tried again
PART_CHUNKS: Final = 20_000  # half an hour: the index of a part's chunks is kept in memory


@dataclass(frozen=True)
class FlightSettings:
    """Where and how much is recorded."""

    directory: Path
    flight: str
    metadata: Mapping[str, str]  # texts about the flight for every part
    fleet: bytes  # snapshot of the fleet file
    part_bytes: int  # size from which a part is followed by the next one
    keep_bytes: int  # limit of all flights of the fleet in the directory; the oldest parts are removed


class FlightWriter:
    """Writes chunks of messages; `problem` is why the disk interrupts it. `opener` creates files."""

    def __init__(
        self,
        settings: FlightSettings,
        opener: Callable[[Path], BinaryIO] = lambda path: path.open("xb"),
        free: Callable[[Path], int] = lambda directory: shutil.disk_usage(directory).free,
    ) -> None:
        self._settings, self._opener, self._free = settings, opener, free
        self._mcap: McapFile | None = None
        self._earlier_bytes = self._writes = 0
        self.path: Path | None = None
        self.problem = ""  # why nothing is recorded; empty while it works

    @property
    def written_bytes(self) -> int:
        """Size of all parts so far."""
        return self._earlier_bytes + (0 if self._mcap is None else self._mcap.written_bytes)

    def write(self, messages: Sequence[LoggedMessage]) -> None:
        """Write messages to the disk; after a failure, only every `RETRY_WRITES` calls try again."""
        if not messages:
            return
        self._writes += 1
        if self.problem and self._writes % RETRY_WRITES:
            return
        try:
            self._write(messages)
            self.problem = ""
        except OSError as error:
            self._stop(error)

    def _write(self, messages: Sequence[LoggedMessage]) -> None:
        mcap, part_bytes = self._mcap, self._settings.part_bytes
        if mcap is not None and (mcap.written_bytes >= part_bytes or mcap.chunks >= PART_CHUNKS):
            self.close()
        if self._mcap is None or self._writes % CHECK_FREE_WRITES == 0:
            self._settings.directory.mkdir(parents=True, exist_ok=True)
            self._make_free()
        mcap = self._begin(messages[0].time_ns) if self._mcap is None else self._mcap
        mcap.add_chunk(messages)

    def _make_free(self) -> None:
        """Remove the oldest flights as long as the disk is almost full; raises OSError if it stays so."""
        # Twice as much is needed to resume, so that parts do not become many and short.
        needed = 2 * FREE_BYTES if self.problem else FREE_BYTES
        earlier, _ = self._flights()
        removable = [path for flight in earlier[:-KEPT_FLIGHTS] for path in flight.parts]
        while self._free(self._settings.directory) < needed:
            if not removable:
                self.close()
                raise OSError(f"less than {needed // 2**20} MiB are free")
            removable.pop(0).unlink(missing_ok=True)

    def _flights(self) -> tuple[list[Flight], list[Flight]]:
        """Earlier flights of the fleet, the oldest first, and this one as far as it is written."""
        settings = self._settings
        fleet = settings.flight.partition("-")[0]
        flights = [f for f in flights_in(settings.directory) if f.name.partition("-")[0] == fleet]
        own = [flight for flight in flights if flight.name == settings.flight]
        return [flight for flight in flights if flight not in own], own

    def _begin(self, time_ns: int) -> McapFile:
        settings = self._settings
        self._make_room()
        number = next_part(settings.directory, settings.flight)
        self.path = part_path(settings.directory, settings.flight, number)
        file = self._opener(self.path)
        with suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # so that `mend` leaves the file alone
        mcap = self._mcap = McapFile(file)
        mcap.add_metadata(METADATA, {**settings.metadata, "part": str(number)})
        mcap.add_attachment(FLEET_ATTACHMENT, settings.fleet, time_ns)
        return mcap

    def _make_room(self) -> None:
        """Remove the oldest parts, those of this flight last, to make room for the next one."""
        earlier, own = self._flights()
        sizes = [(path, path.stat().st_size) for flight in [*earlier, *own] for path in flight.parts]
        for path in too_many(sizes, max(0, self._settings.keep_bytes - self._settings.part_bytes)):
            path.unlink(missing_ok=True)

    def _stop(self, error: OSError) -> None:
        """Note why the disk interrupts the recording, and remove what was written of the last chunk."""
        self.problem = f"{self.path or self._settings.directory}: {error.strerror or error}"
        mcap, self._mcap = self._mcap, None
        if mcap is None:
            return
        self._earlier_bytes += mcap.written_bytes
        with suppress(OSError):
            mcap.file.close()
        with suppress(OSError):
            if mcap.chunks == 0:
                os.unlink(mcap.file.name)
            else:
                os.truncate(mcap.file.name, mcap.written_bytes)

    def close(self) -> None:
        """Complete the present part."""
        if self._mcap is None:
            return
        try:
            self._mcap.finish()
            self._mcap.file.close()
        except OSError as error:
            self._stop(error)
            return
        self._earlier_bytes += self._mcap.written_bytes
        self._mcap = None
