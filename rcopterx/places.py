"""Whether a directory can be used: permissions show neither a full disk, nor a quota, nor missing locks."""

import fcntl
import os
import tempfile
from pathlib import Path


def try_place(path: Path, size_bytes: int = 4096) -> None:
    """Write and lock a file of a directory, and remove it; raises `OSError`."""
    with tempfile.TemporaryFile(dir=path) as file:
        file.write(bytes(size_bytes))
        file.flush()
        os.fsync(file.fileno())
        fcntl.flock(file, fcntl.LOCK_EX)
