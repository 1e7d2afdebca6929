"""Gives memory back that only a start needed: pages of libraries that are still as in their files."""

import ctypes
import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

MADV_DONTNEED = 4
ENDING = ".so"
"""In the name of the file of a library, before its version."""


class Mapping(NamedTuple):
    """A piece of a file in the memory of a process (proc(5), smaps).

    Attributes
    ----------
    start, size
        Where it is, and how many bytes.
    writable
        Whether it may be written to.
    path
        The file.
    resident, written
        Bytes in memory, and how many of them are no longer those of the file.
    """

    start: int
    size: int
    writable: bool
    path: str
    resident: int
    written: int


def mappings(library: str = "", smaps: Path = Path("/proc/self/smaps")) -> Iterator[Mapping]:
    """Pieces of the libraries whose names begin so.

    Raises
    ------
    OSError
        The system does not tell.
    """
    for words, sizes in _entries(smaps.read_text(encoding="utf-8", errors="replace").splitlines()):
        name = os.path.basename(words[5]) if len(words) > 5 else ""
        if ENDING in name and name.startswith(library):
            start, end = (int(word, 16) for word in words[0].split("-"))
            writable = "w" in words[1]
            yield Mapping(start, end - start, writable, words[5], sizes["Rss:"], sizes["Anonymous:"])


def _entries(lines: list[str]) -> Iterator[tuple[list[str], dict[str, int]]]:
    """Words of the first line of each mapping, and its sizes in bytes."""
    words: list[str] = []
    sizes: dict[str, int] = {}
    for line in lines:
        parts = line.split(maxsplit=5)
        if not parts[0].endswith(":"):
            if words:
                yield words, sizes
            words, sizes = parts, {}
        elif parts[-1] == "kB":
            sizes[parts[0]] = 1024 * int(parts[1])
    if words:
        yield words, sizes


def release(library: str = "") -> int:
    """Drop the pages of libraries that are those of their files; who needs them again reads them from there.

    What was written, like the addresses that the loader fills in, stays.

    Parameters
    ----------
    library
        Beginning of the names of their files; by default all.

    Returns
    -------
    int
        Bytes that were in memory.

    Raises
    ------
    OSError
        The system does not tell what is in memory, or drops nothing.
    """
    madvise = ctypes.CDLL(None, use_errno=True).madvise
    madvise.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
    released = 0
    for found in mappings(library):
        if found.writable or found.written:
            continue
        if madvise(found.start, found.size, MADV_DONTNEED):
            number = ctypes.get_errno()
            raise OSError(number, os.strerror(number))
        released += found.resident
    return released
