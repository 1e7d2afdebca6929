"""Logging of the processes of a fleet to standard error; supervised processes add the time."""

import logging
import os
import shutil
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Final

LARGEST_BYTES: Final = 1_000_000  # the content of a larger log is moved to an older one, of which one is kept
SUFFIX: Final = ".log"
OLDER: Final = ".1"
TIME_FORMAT: Final = "%Y-%m-%dT%H:%M:%S"


def set_up() -> None:
    """Log events of this process, and the exception that ends it, to standard error."""
    supervised = "RCOPTERX_PARENT" in os.environ
    handler = logging.StreamHandler(sys.stderr)
    form = "%(asctime)s.%(msecs)03dZ %(levelname)s %(message)s" if supervised else "%(message)s"
    formatter = logging.Formatter(form, TIME_FORMAT)
    formatter.converter = time.gmtime
    handler.setFormatter(formatter)
    logging.basicConfig(level=logging.INFO if supervised else logging.WARNING, handlers=[handler], force=True)
    sys.excepthook = _log_exception


def _log_exception(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    logging.critical("ends by %s: %s", kind.__name__, error, exc_info=(kind, error, traceback))


def append(path: Path, lines: list[str]) -> None:
    """Append lines to a log; ignore a failing disk."""
    now_s = time.time()
    stamp = f"{time.strftime(TIME_FORMAT, time.gmtime(now_s))}.{int(now_s * 1000) % 1000:03d}Z"
    with suppress(OSError), path.open("a", encoding="utf-8") as file:
        file.writelines(f"{stamp} INFO {line}\n" for line in lines)


def rotate(directory: Path) -> None:
    """Move each large log to its older one, ignoring a failing disk; processes append to the same file."""
    with suppress(OSError):
        for path in directory.glob(f"*{SUFFIX}"):
            if path.stat().st_size > LARGEST_BYTES:
                shutil.copyfile(path, path.with_name(path.name + OLDER))
                os.truncate(path, 0)
