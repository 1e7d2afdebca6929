"""`python -m rcopterx.compiling`: compile all kernels ahead of their first use."""

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
    """Compile what the cache lacks, several modules at a time, and remove old versions from it."""
    path = directory()
    if path is None:
        print("kernels cannot be kept: no directory is writable, see RCOPTERX_KERNELS", file=sys.stderr)
        return 0
    if (path / COMPLETE).exists():
        return 0
    print("rcopterx compiles its kernels for this computer, once ...", file=sys.stderr, flush=True)
    start_s = time.monotonic()
    problems = _compile_modules()
    if problems:
        print(*problems, sep="\n", file=sys.stderr)
        return 1
    (path / COMPLETE).touch()
    remove_unused(path.parent, time.time())
    print(f"... compiled in {time.monotonic() - start_s:.0f} s", file=sys.stderr)
    return 0


def _compile_modules() -> list[str]:
    """Compile all modules in forks of this process, which has imported the compiler; return what failed."""
    compiler = importlib.import_module("rcopterx.compiling.compiled")
    compiler.Announcer.announced = True
    try:
        with ProcessPoolExecutor(os.cpu_count(), mp_context=multiprocessing.get_context("fork")) as pool:
            return [problem for problem in pool.map(_compile_module, MODULES) if problem]
    except BrokenProcessPool as error:
        return [str(error)]


def _compile_module(module: str) -> str:
    try:
        importlib.import_module(f"rcopterx.{module}")
    except Exception:  # noqa: BLE001 - the compiler raises errors of many kinds
        return f"{module}: {traceback.format_exc().strip()}"
    return ""


if __name__ == "__main__":
    sys.exit(main())
