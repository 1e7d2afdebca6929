"""Whether directories can be used, as permissions hide full disks, quotas and missing locks; files."""

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


def replace_file(path: Path, content: bytes, mode: int = 0o666) -> None:
    """Write a file with permissions `mode` in place of an earlier one, which stays after an `OSError`."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}")
    temporary.unlink(missing_ok=True)
    try:
        with os.fdopen(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
