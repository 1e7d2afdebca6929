"""Raw recordings of the TCP stream: the fixture a user sends with a bug report.

File format, all numbers little-endian::

    file   = 8 bytes "RCXRAW1\\n" | record*
    record = f64 time_s | u8 event | u32 length | length bytes

`time_s` is the recorder's monotonic clock. Event 0: a connection was opened (no bytes); 1: bytes received;
2: the connection ended (the reason as UTF-8 text). A file cut in the middle of a record, as after a crash,
is read up to the last whole record. A thread of its own writes the file: a slow disk must not delay a pose.
"""

import struct
import threading
from collections.abc import Callable
from enum import IntEnum
from pathlib import Path
from queue import SimpleQueue
from typing import BinaryIO, Self

FILE_MAGIC = b"RCXRAW1\n"
RECORD = struct.Struct("<dBI")  # time, event, length
MAX_WAITING_BYTES = 32 * 1024 * 1024  # about 15 minutes of three subjects; then the recording ends
CLOSE_LIMIT_S = 2.0
MOST_FILES = 1000


class RawEvent(IntEnum):
    """Kind of a record."""

    OPENED = 0
    RECEIVED = 1
    ENDED = 2


class RawRecorder:
    """Writes a recording; the first failure of `write` ends it and is kept in `error`, nothing is raised."""

    def __init__(self, write: Callable[[bytes], object], clock: Callable[[], float]) -> None:
        self._write_bytes = write
        self._clock = clock
        self.error: str | None = None
        self.recorded_bytes = 0
        self._write(FILE_MAGIC)

    def record(self, event: RawEvent, data: bytes = b"") -> None:
        """Store an event of a connection, with received bytes or the reason of its end."""
        self._write(RECORD.pack(self._clock(), event, len(data)) + data)

    def _write(self, data: bytes) -> None:
        if self.error is not None:
            return
        try:
            self._write_bytes(data)
            self.recorded_bytes += len(data)
        except (OSError, ValueError) as error:  # ValueError: the file has been closed
            self.error = f"raw recording stopped: {error}"


class RecordingFileError(ValueError):
    """The file cannot be created; names the path and the reason."""


def check_creatable(path: Path) -> None:
    """Raise `RecordingFileError` if a recording cannot be created; nothing is left behind."""
    with _created(path) as file:
        Path(file.name).unlink()


def _created(path: Path) -> BinaryIO:
    """Open a new file: the path, or with a number if there is a file already, so that nothing is lost."""
    if path.is_dir():
        raise RecordingFileError(f"{path} is a directory, a file is needed")
    for number in range(1, MOST_FILES):
        candidate = path if number == 1 else path.with_stem(f"{path.stem}-{number}")
        try:
            return candidate.open("xb")
        except FileExistsError:
            continue
        except OSError as error:
            raise RecordingFileError(f"{candidate} cannot be created: {error.strerror}") from None
    raise RecordingFileError(f"{path}: there are {MOST_FILES} recordings of that name already")


class RecordingFile:
    """A file to record into."""

    def __init__(self, file: BinaryIO, path: Path) -> None:
        self.path = path
        self._file = file
        self._queue: SimpleQueue[bytes | None] = SimpleQueue()
        self._queued_bytes = 0
        self._written_bytes = 0
        self._error: OSError | None = None
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._thread.start()

    @classmethod
    def create(cls, path: Path) -> Self:
        """Create a new file, its name numbered if one exists; raises `RecordingFileError`."""
        file = _created(path)
        return cls(file, Path(file.name))

    def write(self, data: bytes) -> None:
        """Queue bytes for writing; `OSError` if earlier ones failed or the disk is too slow."""
        if self._error is not None:
            raise self._error
        if self._queued_bytes + len(data) - self._written_bytes > MAX_WAITING_BYTES:
            raise OSError(f"the disk of {self.path} is {MAX_WAITING_BYTES} bytes behind")
        self._queued_bytes += len(data)
        self._queue.put(data)

    def close(self) -> None:
        """Write the queued bytes, for a limited time, and close the file."""
        self._queue.put(None)
        self._thread.join(CLOSE_LIMIT_S)

    def _run(self) -> None:
        try:
            with self._file as file:
                while (data := self._queue.get()) is not None:
                    file.write(data)
                    self._written_bytes += len(data)
                    if self._queue.empty():
                        file.flush()
        except OSError as error:
            self._error = error
