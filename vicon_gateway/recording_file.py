"""The file behind a raw recording, written in a thread of its own: a slow disk must not delay a pose."""

import threading
from pathlib import Path
from queue import SimpleQueue
from typing import BinaryIO, Self

MAX_WAITING_BYTES = 32 * 1024 * 1024
"""About 15 minutes of three subjects at 50 Hz; a disk that is further behind ends the recording."""
CLOSE_LIMIT_S = 2.0
MOST_FILES = 1000


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
    """A file to record into; it is closed at the end."""

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
        """Create a new file, with a number added to its name if there is one already; raises
        `RecordingFileError`.
        """
        file = _created(path)
        return cls(file, Path(file.name))

    def write(self, data: bytes) -> None:
        """Queue bytes for writing; raises `OSError` if earlier ones could not be written, or the disk is too
        slow.
        """
        if self._error is not None:
            raise self._error
        if self._queued_bytes + len(data) - self._written_bytes > MAX_WAITING_BYTES:
            raise OSError(f"the disk of {self.path} is {MAX_WAITING_BYTES} bytes behind")
        self._queued_bytes += len(data)
        self._queue.put(data)

    def flush(self) -> None:
        """Nothing to do: whatever was written goes to the file as soon as nothing more is waiting."""

    def close(self) -> None:
        """Write the queued bytes, for a limited time, and close the file."""
        self._queue.put(None)
        self._thread.join(CLOSE_LIMIT_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

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
