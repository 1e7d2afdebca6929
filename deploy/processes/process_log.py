"""Logging to standard error, which may block: loops only queue lines. Supervised processes add the time."""

import logging
import os
import shutil
import sys
import time
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Final, TextIO

LARGEST_BYTES: Final = 1_000_000  # the content of a larger log is moved to an older one, of which one is kept
SUFFIX: Final = ".log"
OLDER: Final = ".1"
TIME_FORMAT: Final = "%Y-%m-%dT%H:%M:%S"
MOST_WAITING: Final = 1000  # lines that have not been written; further ones are dropped
CLOSE_LIMIT_S: Final = 1.0  # for the last lines of a process
ROTATE_S: Final = 0.5


class QueueingHandler(logging.Handler):
    """Writes records to a stream in a thread of its own, which does not keep the process from ending."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__()
        self._stream = stream
        self._lines: SimpleQueue[str | None] = SimpleQueue()
        self._dropped = 0
        self._thread = Thread(target=self._run, name="log", daemon=True)
        self._thread.start()

    def emit(self, record: logging.LogRecord) -> None:
        """Queue the line of a record; with too many waiting it is dropped."""
        if self._lines.qsize() >= MOST_WAITING:
            self._dropped += 1
            return
        if self._dropped:
            self._lines.put(f"{self._dropped} lines were dropped here")
            self._dropped = 0
        self._lines.put(self.format(record))

    def _run(self) -> None:
        while (line := self._lines.get()) is not None:
            with suppress(OSError, ValueError):  # ValueError: the stream is closed
                self._stream.write(f"{line}\n")
                self._stream.flush()

    def close(self) -> None:
        """Write the lines that wait, for a limited time; the interpreter calls it at its end."""
        self._lines.put(None)
        self._thread.join(CLOSE_LIMIT_S)
        super().close()


def set_up() -> None:
    """Log events of this process, and the exception that ends it, to standard error."""
    supervised = "RCOPTERX_PARENT" in os.environ
    handler = QueueingHandler(sys.stderr)
    form = "%(asctime)s.%(msecs)03dZ %(levelname)s %(message)s" if supervised else "%(message)s"
    formatter = logging.Formatter(form, TIME_FORMAT)
    formatter.converter = time.gmtime
    handler.setFormatter(formatter)
    logging.basicConfig(level=logging.INFO if supervised else logging.WARNING, handlers=[handler], force=True)
    sys.excepthook = lambda kind, error, traceback: logging.critical(
        "ends by %s: %s", kind.__name__, error, exc_info=(kind, error, traceback)
    )


class LauncherLog:
    """Log of a launcher, whose loops may not wait for a disk: a thread writes it and rotates all logs."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._lines: SimpleQueue[list[str] | None] = SimpleQueue()
        self._thread = Thread(target=self._run, name="launcher log", daemon=True)
        self._thread.start()

    def append(self, lines: list[str]) -> None:
        """Queue lines, with the present time; a failing disk is ignored."""
        now_s = time.time()
        stamp = f"{time.strftime(TIME_FORMAT, time.gmtime(now_s))}.{int(now_s * 1000) % 1000:03d}Z"
        self._lines.put([f"{stamp} INFO {line}\n" for line in lines])

    def _run(self) -> None:
        path = self._directory / f"launcher{SUFFIX}"
        while True:
            lines: list[str] | None = []
            with suppress(Empty):
                lines = self._lines.get(timeout=ROTATE_S)
            if lines is None:
                return
            if lines:
                with suppress(OSError), path.open("a", encoding="utf-8") as file:
                    file.writelines(lines)
            rotate(self._directory)

    def close(self) -> None:
        """Write the lines that wait, for a limited time."""
        self._lines.put(None)
        self._thread.join(CLOSE_LIMIT_S)


def rotate(directory: Path) -> None:
    """Move each large log to its older one, ignoring a failing disk; processes append to the same file."""
    with suppress(OSError):
        for path in directory.glob(f"*{SUFFIX}"):
            if path.stat().st_size > LARGEST_BYTES:
                shutil.copyfile(path, path.with_name(path.name + OLDER))
                os.truncate(path, 0)
