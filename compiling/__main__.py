"""`python -m rcopterx.compiling`: compile all kernels, so that what starts later finds them."""

import importlib
import multiprocessing
import os
import sys
import time
import traceback
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from rcopterx.compiling.cache import COMPLETE, MODULES, directory, remove_unused


def main() -> int:
    """Compile what is not compiled yet, several modules at a time, and note that everything is.

    Whatever older versions left behind is removed then.
    """
    path = directory()
    if path is None:
        print("kernels cannot be kept: no directory is writable, see RCOPTERX_KERNELS", file=sys.stderr)
        return 0
    if (path / COMPLETE).exists():
        return 0
    print("rcopterx compiles its kernels for this computer, once ...", file=sys.stderr, flush=True)
    start_s = time.monotonic()
    problems = [problem for problem in _problems() if problem is not None]
    if problems:
        print(*problems, sep="\n", file=sys.stderr)
        return 1
    (path / COMPLETE).touch()
    remove_unused(path.parent)
    print(f"... compiled in {time.monotonic() - start_s:.0f} s", file=sys.stderr)
    return 0


def _problems() -> list[str | None]:
    """Compile each module of kernels; what is wrong with it, or None.

    Workers are forks of a process that has imported the compiler, and go from module to module: to import it
    takes a second, and to compile for the first time another one.
    """
    compiler = importlib.import_module("rcopterx.compiling.compiled")
    compiler.Announcer.told = True
    forking = multiprocessing.get_context("fork")
    try:
        with ProcessPoolExecutor(os.cpu_count(), mp_context=forking) as pool:
            return list(pool.map(_problem, MODULES))
    except BrokenProcessPool as error:
        return [str(error)]


def _problem(module: str) -> str | None:
    """Compile a module; what went wrong, if anything."""
    try:
        importlib.import_module(f"rcopterx.{module}")
    except Exception:  # noqa: BLE001 - whatever the compiler raises is told
        return f"{module}: {traceback.format_exc().strip()}"
    return None


if __name__ == "__main__":
    sys.exit(main())
