"""Reference cycles: what a loop that has switched garbage collection off would keep for ever."""

import gc
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

SHOWN = 20
PARTS = 4
KEPT_SHARE = 0.2
"""Of a block of memory a period; a list that gets an item in each keeps 1."""


@contextmanager
def no_garbage() -> Iterator[None]:
    """Fail if what happens meanwhile leaves objects that only a garbage collection removes."""
    gc.collect()
    gc.disable()
    flags = gc.get_debug()
    try:
        yield
        gc.set_debug(gc.DEBUG_SAVEALL)
        gc.collect()
        found = Counter(f"{type(item).__module__}.{type(item).__qualname__}" for item in gc.garbage)
        samples = [repr(item)[:200] for item in gc.garbage[:SHOWN]]
        assert not found, f"{found.most_common(SHOWN)}\n" + "\n".join(samples)
    finally:
        gc.set_debug(flags)
        gc.garbage.clear()
        gc.enable()
        gc.collect()


def assert_flat(period: Callable[[int], object], periods: int) -> None:
    """Run a loop for so many periods: a collection finds nothing afterwards, and no memory is kept.

    Caches and histories fill at some time; what grows for ever grows in each part of the run.
    """
    grown = []
    length = periods // PARTS
    for begin in range(0, PARTS * length, length):
        before = sys.getallocatedblocks()
        with no_garbage():
            for number in range(begin, begin + length):
                period(number)
        # The collection at the end has also emptied the lists of free tuples.
        grown.append(sys.getallocatedblocks() - before)
    assert min(grown) < KEPT_SHARE * length, f"{grown} blocks in each {length} periods"
