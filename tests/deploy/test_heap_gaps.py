"""Gaps of a heap are filled, so that what comes later lies behind all that is there, and opened again."""

import subprocess
import sys

import pytest

PROGRAM = """
import ctypes
from array import array
from rcopterx.deploy.heap_gaps import HeapGaps

library = ctypes.CDLL(None)
library.malloc.restype, library.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
library.malloc.argtypes, library.sbrk.restype = [ctypes.c_size_t], ctypes.c_void_p
gaps = HeapGaps()

def free_bytes():
    state = gaps._state()
    return state.fordblks - state.keepcost

SIZE, COUNT = {size}, {count}
blocks = array("Q", (library.malloc(SIZE) for _ in range(2 * COUNT)))
for block in blocks[::2]:
    library.free(block)
empty = free_bytes()
gaps.fill()
filled = free_bytes()
beyond = sum(library.malloc(SIZE) > max(blocks) for _ in range(20))
gaps.open()
print(empty, filled, free_bytes(), beyond)
"""


@pytest.mark.parametrize(("size", "count"), [(40, 100_000), (500, 10_000), (3_000, 2_000), (60_000, 100)])
def test_gaps_are_filled_and_opened_again(size: int, count: int) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(size=size, count=count)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    empty, filled, opened, beyond = map(int, done.stdout.split())
    assert empty > 0.9 * size * count
    assert filled < 0.1 * empty
    assert opened > 0.9 * empty
    assert beyond == 20, "some blocks lie between those that stayed"
