"""Reference cycles: what a loop that has switched garbage collection off would keep for ever."""

import gc
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

SHOWN = 20


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
