"""Fills the gaps of the C library's heap, so that forked processes write to fresh pages.

What a start frees leaves gaps between blocks that stay. A forked process that puts something into one has its
own copy of that page from then on, with all that stays on it: 3 MB in each process of a fleet.
"""

import ctypes
from array import array
from typing import Any, Final

LARGEST_BYTES: Final = 1 << 16
"""Blocks that the C library surely keeps in its heap."""
SMALL_BYTES: Final = 1024
"""Up to here each size has gaps of its own."""
STEP_BYTES: Final = 16
HEADER_BYTES: Final = 8
"""Of a block, as `malloc` counts."""
_SIZES: Final = (
    *(LARGEST_BYTES >> power for power in range(7)),
    *range(SMALL_BYTES - HEADER_BYTES, HEADER_BYTES, -STEP_BYTES),
)
_COUNTERS: Final = (
    "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost",
)  # fmt: skip


class HeapState(ctypes.Structure):
    """What mallinfo2(3) tells [bytes]; `keepcost` are free at the end of the heap."""

    _fields_ = [(name, ctypes.c_size_t) for name in _COUNTERS]


class HeapGaps:
    """The gaps of this process's heap.

    Raises
    ------
    OSError
        The C library is not glibc 2.33 or newer.
    """

    def __init__(self) -> None:
        library: Any = ctypes.CDLL(None)
        try:
            self._malloc, self._free = library.malloc, library.free
            self._state, self._end, self._trim = library.mallinfo2, library.sbrk, library.malloc_trim
        except AttributeError as error:
            raise OSError(f"the C library cannot tell of its heap: {error}") from error
        self._malloc.argtypes, self._malloc.restype = [ctypes.c_size_t], ctypes.c_void_p
        self._free.argtypes, self._free.restype = [ctypes.c_void_p], None
        self._state.restype = HeapState
        self._end.argtypes, self._end.restype = [ctypes.c_ssize_t], ctypes.c_void_p
        self._blocks = array("Q")

    def fill(self) -> None:
        """Give back pages in gaps, then fill these until there are none."""
        self._trim(0)
        end = self._end(0) - self._state().keepcost
        for size in _SIZES:
            while block := self._malloc(size):
                if block >= end - size:
                    self._free(block)
                    break
                self._blocks.append(block)

    def open(self) -> None:
        """Make what was filled free again."""
        for block in self._blocks:
            self._free(block)
        self._blocks = array("Q")
