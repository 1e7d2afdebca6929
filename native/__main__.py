"""`python -m rcopterx.native`: compile all kernels, so that what starts later finds them."""

import importlib
import sys
import time

from rcopterx.native.cache import COMPLETE, MODULES, directory


def main() -> None:
    """Compile what is not compiled yet, and note that everything is."""
    path = directory()
    if path is None:
        print("kernels cannot be kept: no directory is writable, see RCOPTERX_KERNELS", file=sys.stderr)
        return
    if (path / COMPLETE).exists():
        return
    start_s = time.monotonic()
    for module in MODULES:
        importlib.import_module(f"rcopterx.native.{module}")
    (path / COMPLETE).touch()
    print(f"... compiled in {time.monotonic() - start_s:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
