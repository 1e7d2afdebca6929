"""Where compiled kernels are kept, and compiling them before anybody waits for them.

They are compiled once for each version of their sources, of numba and of Python, and for each kind of
processor, each into a directory of its own; those used last are kept. This module imports no numba: who only
starts processes needs none.
"""

import fcntl
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Final

COMPLETE: Final = "complete"
"""File in the directory of the kernels from when on all of them are there."""
MODULES: Final = (
    "native.settling",
    "native.within_bounds",
    "native.kalman",
    "native.bounds",
    "native.cascade",
    "native.chain",
    "native.helicopter",
    "native.turbulence",
    "native.plans",
    "native.lateral",
    "native.noise",
    "native.motion",
    "native.interior",
    "native.lateral_problem",
    "native.watching",
    "native.flight",
)
"""Modules of kernels, those first that take longest: nobody shall wait for one of them alone at the end."""
VARIABLE: Final = "RCOPTERX_KERNELS"
"""Environment variable with the directory to keep kernels in, instead of the user's cache."""
KEPT: Final = 10
"""Directories that stay, those used last, besides all that processes use now."""
_NAME: Final = "kernels-"
_REMOVED: Final = "removed-"
_NAMES_OF_PROCESSOR: Final = ("model name", "flags", "Features", "CPU part", "CPU implementer")


_held: Final[list[int]] = []
"""Locks of the directory that this process uses: kept until it and its forks have ended."""


@cache
def directory() -> Path | None:
    """Directory of the kernels of this version and processor, created if missing.

    It is private, because what lies in it is executed, and it stays as long as this process lives. None if no
    place is writable.
    """
    name = f"{_NAME}{_digest()}"
    for base in _bases():
        path = base / name
        try:
            base.mkdir(parents=True, exist_ok=True)
            descriptor = _use(path)
        except OSError:
            continue
        if os.fstat(descriptor).st_uid == os.getuid() and os.access(path, os.W_OK):
            os.utime(path)
            _held.append(descriptor)
            return path
        os.close(descriptor)
    return None


def _use(path: Path) -> int:
    """Create a directory if missing, and keep it there until the returned descriptor is closed."""
    while True:
        with suppress(FileExistsError):
            os.mkdir(path, 0o700)
        # Somebody may remove it before it is locked.
        with suppress(FileNotFoundError):
            descriptor = _locked(path, fcntl.LOCK_SH)
            if path.exists() and os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
            os.close(descriptor)


def _locked(path: Path, kind: int) -> int:
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, kind)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def remove_unused(base: Path) -> list[str]:
    """Remove directories of kernels that no process uses, except those used last; names of the removed."""
    used_ns = {}
    for path in base.glob(f"{_NAME}*"):
        with suppress(FileNotFoundError):  # removed by somebody else meanwhile
            used_ns[path] = path.lstat().st_mtime_ns
    oldest = sorted(used_ns, key=used_ns.__getitem__, reverse=True)[KEPT:]
    removed = [path.name for path in oldest if _set_aside(path)]
    for path in base.glob(f"{_REMOVED}*"):
        shutil.rmtree(path, ignore_errors=True)
    return removed


def _set_aside(path: Path) -> bool:
    """Rename a directory that no process uses, so that whoever wants it next makes a new one."""
    try:
        descriptor = _locked(path, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    try:
        path.rename(path.with_name(path.name.replace(_NAME, _REMOVED, 1)))
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return True


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
    place = Path(__file__).parents[1]
    for module in ("compiling.compiled", *sorted(MODULES)):
        digest.update((place / f"{module.replace('.', '/')}.py").read_bytes())
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
    done = subprocess.run([sys.executable, "-m", "rcopterx.compiling"], check=False)
    if done.returncode:
        raise OSError(
            f"the kernels cannot be compiled: python -m rcopterx.compiling ended with {done.returncode}"
        )
