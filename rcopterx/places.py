"""Whether directories can be used, as permissions hide full disks, quotas and missing locks; locked files."""

import fcntl
import os
import tempfile
from pathlib import Path
from typing import IO


def try_place(path: Path, size_bytes: int = 4096) -> None:
    """Write and lock a file of a directory, and remove it; raises `OSError`."""
    with tempfile.TemporaryFile(dir=path) as file:
        file.write(bytes(size_bytes))
        file.flush()
        os.fsync(file.fileno())
        fcntl.flock(file, fcntl.LOCK_EX)


def is_locked(file: int | IO[bytes]) -> bool:
    """Return whether another process keeps a file locked for itself; raises `OSError`."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(file, fcntl.LOCK_UN)
    return False
