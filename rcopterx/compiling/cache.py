"""The cache of compiled kernels: a private directory for each version of their sources and kind of computer.

This module does not import numba: the launcher compiles kernels in another process and needs none of it.
"""

import fcntl
import hashlib
import os
import platform
import re
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Final

from rcopterx.places import try_place
from rcopterx.tables import table_beside

COMPLETE: Final = "complete"  # empty file in a directory of kernels that holds all of them
MODULES: Final[tuple[str, ...]] = tuple(table_beside(__file__, "kernels")["modules"])
"""Modules of kernels, in an order in which two compiling processes rarely wait for each other."""
VARIABLE: Final = "RCOPTERX_KERNELS"  # environment variable with the cache's directory, if not the user's
KEPT: Final = 10  # number of versions that stay in the cache, besides those of the last `KEPT_S`
KEPT_S: Final = 24 * 3600.0
INTERRUPTED: Final = 130  # exit code of a compilation that Ctrl-C has ended
_PREFIX: Final = "kernels-"
_IMPORT: Final = re.compile(r"^from rcopterx\.([\w.]+) import (\([^)]*\)|.+)$", re.MULTILINE)
_WORD: Final = re.compile(r"\w+")
NEEDED_BYTES: Final = 4 * 1024 * 1024  # about what all kernels take
_PROCESSOR: Final = ("model name", "flags", "Features", "CPU part", "CPU implementer")


@cache
def directory() -> Path | None:
    """Return the private directory of this version's kernels, created if missing; None if there is no place.

    Its content is executed: a place that belongs to another user, or that others may write to, is refused.
    """
    name = f"{_PREFIX}{_digest()}"
    for base in _bases():
        try:
            base.mkdir(parents=True, exist_ok=True, mode=0o700)
            base = base.resolve()
            _check_private(base)
            path = base / name
            path.mkdir(exist_ok=True, mode=0o700)
            _check_private(path)
            if not (path / COMPLETE).exists():
                try_place(path, NEEDED_BYTES)
            os.utime(path)
        except OSError:
            continue
        return path
    return None


def _bases() -> Iterator[Path]:
    """Places of the cache in the order in which they are tried."""
    home = os.path.expanduser("~")  # "~" itself where neither HOME nor the system names one
    chosen, cached = os.environ.get(VARIABLE), os.environ.get("XDG_CACHE_HOME")
    if chosen:
        yield Path(chosen)
    if cached or os.path.isabs(home):
        yield (Path(cached) if cached else Path(home) / ".cache") / "rcopterx"
    yield Path(tempfile.gettempdir()) / f"rcopterx-kernels-{os.getuid()}"


def _check_private(path: Path) -> None:
    """Refuse a directory that another user could fill, or replace in a directory above it."""
    for place in (path, *path.parents):
        status = place.lstat()
        mine = status.st_uid == os.getuid() or (status.st_uid == 0 and place != path)
        # In a directory like /tmp others cannot rename what is ours.
        sticky = status.st_mode & stat.S_ISVTX and place != path
        if not mine or (status.st_mode & 0o022 and not sticky):
            raise PermissionError(f"{place} belongs to another user, or others may write to it")


def _digest() -> str:
    """Digest of all sources that machine code depends on; numba checks a kernel's own file only."""
    digest = hashlib.sha256()
    for module, source in sorted(sources(MODULES).items()):
        digest.update(module.encode() + source)
    parts = [version("numba"), version("numpy"), sys.version, platform.machine()]
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    parts += sorted({line for line in lines if line.startswith(_PROCESSOR)})
    digest.update("\n".join(parts).encode())
    return digest.hexdigest()[:16]


def sources(modules: Iterable[str], package: Path = Path(__file__).parents[1]) -> dict[str, bytes]:
    """Return the sources of modules and of all modules of the package that they import, at any depth."""
    found: dict[str, bytes] = {}
    names = list(modules)
    while names:
        name = names.pop()
        path = package / f"{name.replace('.', '/')}.py"
        if name not in found and path.is_file():
            found[name] = path.read_bytes()
            for parent, members in _IMPORT.findall(found[name].decode()):
                # A member is a module, or a name that the parent defines.
                names += [parent, *(f"{parent}.{member}" for member in _WORD.findall(members))]
    return found


@contextmanager
def only_one(path: Path, module: str) -> Iterator[None]:
    """Let one process at a time compile a module; the others then load what it has compiled."""
    # A process that has run for days may find its directory removed.
    path.mkdir(exist_ok=True, mode=0o700)
    with (path / f"{module}.lock").open("ab") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def remove_unused(base: Path, now_s: float) -> None:
    """Remove versions of kernels that no process has used recently; `now_s` is the Unix time."""
    used_s = {}
    for path in base.glob(f"{_PREFIX}*"):
        with suppress(FileNotFoundError):  # another process may remove them as well
            used_s[path] = path.stat().st_mtime
    for path in sorted(used_s, key=used_s.__getitem__, reverse=True)[KEPT:]:
        if used_s[path] < now_s - KEPT_S:
            (path / COMPLETE).unlink(missing_ok=True)
            shutil.rmtree(path, ignore_errors=True)


def compile_all() -> None:
    """Compile all kernels that the cache lacks in another process, which prints; `OSError` if it fails."""
    path = directory()
    if path is not None and (path / COMPLETE).exists():
        return
    done = subprocess.run([sys.executable, "-m", "rcopterx.compiling"], check=False)
    if done.returncode == INTERRUPTED:
        raise KeyboardInterrupt
    if done.returncode:
        raise OSError(
            f"the kernels cannot be compiled: python -m rcopterx.compiling ended with {done.returncode}"
        )
