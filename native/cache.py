"""Where compiled kernels are kept, and compiling them before anybody waits for them.

They are compiled once for each version of their sources, of numba and of Python, and for each kind of
processor. This module imports no numba: who only starts processes needs none.
"""

import fcntl
import hashlib
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Final

COMPLETE: Final = "complete"
"""File in the directory of the kernels from when on all of them are there."""
MODULES: Final = ("bounds", "cascade", "chain", "kalman", "lateral", "motion", "noise", "plans")
"""Modules of kernels."""
VARIABLE: Final = "RCOPTERX_KERNELS"
"""Environment variable with the directory to keep kernels in, instead of the user's cache."""
_NAMES_OF_PROCESSOR: Final = ("model name", "flags", "Features", "CPU part", "CPU implementer")


@cache
def directory() -> Path | None:
    """Directory of the kernels of this version and processor, created if missing.

    It is private, because what lies in it is executed. None if no place is writable.
    """
    name = f"kernels-{_digest()}"
    for base in _bases():
        path = base / name
        try:
            path.mkdir(parents=True, exist_ok=True, mode=0o700)
            if path.stat().st_uid == os.getuid() and os.access(path, os.W_OK):
                return path
        except OSError:
            continue
    return None


def _bases() -> Iterator[Path]:
    """Where the directory may lie, in the order in which to try."""
    chosen = os.environ.get(VARIABLE)
    if chosen:
        yield Path(chosen)
    cached = os.environ.get("XDG_CACHE_HOME")
    yield (Path(cached) if cached else Path(os.path.expanduser("~")) / ".cache") / "rcopterx"
    yield Path(tempfile.gettempdir()) / f"rcopterx-{os.getuid()}"


def _digest() -> str:
    """Of all that the compiled code depends on: numba itself looks at the file of a kernel only, and not at
    the functions that it calls."""
    digest = hashlib.sha256()
    # numba tells checkouts apart by their place.
    place = Path(__file__).parent
    for source in sorted(place.glob("*.py")):
        digest.update(source.read_bytes())
    digest.update(
        f"{place} {version('numba')} {version('numpy')} {sys.version} {platform.machine()}".encode()
    )
    try:
        processor = Path("/proc/cpuinfo").read_text(encoding="utf-8").partition("\n\n")[0]
    except OSError:
        processor = ""
    lines = [line for line in processor.splitlines() if line.startswith(_NAMES_OF_PROCESSOR)]
    digest.update("\n".join(lines).encode())
    return digest.hexdigest()[:16]


@contextmanager
def only_one(path: Path, module: str) -> Iterator[None]:
    """One process at a time per module of kernels: who comes later finds what the first one has compiled."""
    with (path / f"{module}.lock").open("ab") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def compile_all() -> None:
    """Compile all kernels in a process of its own, unless that was done; it tells so on the standard error.

    Raises
    ------
    OSError
        They cannot be compiled; the process has told why.
    """
    path = directory()
    if path is not None and (path / COMPLETE).exists():
        return
    done = subprocess.run([sys.executable, "-m", "rcopterx.native"], check=False)
    if done.returncode:
        raise OSError(
            f"the kernels cannot be compiled: python -m rcopterx.native ended with {done.returncode}"
        )
