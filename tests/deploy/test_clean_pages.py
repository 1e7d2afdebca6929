"""Promises of clean pages: what was read from a library's file leaves memory, and the library works on."""

from pathlib import Path

import numba
import numpy as np
import pytest

from rcopterx.deploy.clean_pages import mappings, release
from rcopterx.native.chain import chain_solve

LIBRARY = "libllvmlite"
SMAPS = """\
7f00-8f00 r-xp 00001000 fe:00 5325881                    /a b/libllvmlite.so
Size:                  4 kB
Rss:                   4 kB
Anonymous:             0 kB
VmFlags: rd ex mr mw me sd
9000-9800 r--p 00002000 fe:00 5325881                    /a b/libllvmlite.so
Rss:                   2 kB
Anonymous:             1 kB
VmFlags: rd mr mw me sd
a000-b000 rw-p 00000000 00:00 0
Rss:                   4 kB
Anonymous:             4 kB
b000-c000 r-xp 00000000 fe:00 77                         /lib/libother.so
Rss:                   4 kB
Anonymous:             0 kB
"""


def resident() -> int:
    return sum(found.resident for found in mappings(LIBRARY))


def solved() -> np.ndarray:
    solution = np.array([4.0, 9.0])
    chain_solve(np.array([[2.0, 0.0], [3.0, 0.0]]), solution)
    return solution


def test_the_pages_of_a_library_are_dropped_and_it_works_on() -> None:
    expected = solved()
    before = resident()
    assert release(LIBRARY) > before // 2
    assert resident() < before // 2
    assert solved().tolist() == expected.tolist()
    assert numba.njit(lambda number: number + 41)(1) == 42


def test_a_library_that_is_not_there_has_nothing_to_release() -> None:
    assert release("libthereisnosuch") == 0


def test_mappings_are_those_of_the_library_and_tell_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "smaps"
    path.write_text(SMAPS)
    code, relocated = mappings(LIBRARY, path)
    assert (code.start, code.size, code.writable) == (0x7F00, 0x1000, False)
    assert code.path == "/a b/libllvmlite.so"
    assert (code.resident, code.written) == (4096, 0)
    assert relocated.written == 1024


def test_by_default_mappings_are_those_of_all_libraries_and_of_no_other_file(tmp_path: Path) -> None:
    path = tmp_path / "smaps"
    path.write_text(SMAPS.replace("/lib/libother.so", "/lib/libother.so.1") + SMAPS.replace(".so", ".db"))
    assert [found.path for found in mappings(smaps=path)] == [
        "/a b/libllvmlite.so",
        "/a b/libllvmlite.so",
        "/lib/libother.so.1",
    ]


def test_a_system_that_does_not_tell_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nothing"):
        next(mappings(LIBRARY, tmp_path / "nothing"))
