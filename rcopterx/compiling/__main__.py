"""`python -m rcopterx.compiling`: compile all kernels ahead of their first use."""

import importlib
import multiprocessing
import os
import signal
import sys
import time
import traceback
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import NamedTuple

from rcopterx.compiling.cache import COMPLETE, INTERRUPTED, MODULES, VARIABLE, directory, remove_unused


def main() -> int:
    """Compile what the cache lacks, several modules at a time, and remove old versions from it."""
    if (path := directory()) is None:
        print(f"kernels are compiled in memory: no place keeps them, see {VARIABLE}", file=sys.stderr)
        return 0
    if (path / COMPLETE).exists():
        return 0
    print("rcopterx compiles its kernels for this computer, once ...", file=sys.stderr, flush=True)
    start_s = time.monotonic()
    results = _compile_modules()
    if problems := [each.problem for each in results if each.problem]:
        print(*problems, sep="\n", file=sys.stderr)
        return 1
    try:
        if not_kept := [each.not_kept for each in results if each.not_kept]:
            raise OSError(not_kept[0])
        (path / COMPLETE).touch()
        remove_unused(path.parent, time.time())
    except OSError as error:
        print(f"kernels are compiled in memory: {path} keeps none: {error}", file=sys.stderr)
        return 0
    print(f"... compiled in {time.monotonic() - start_s:.0f} s", file=sys.stderr)
    return 0


class _Result(NamedTuple):
    problem: str = ""
    not_kept: str = ""  # why machine code was not stored


def _compile_modules() -> list[_Result]:
    """Compile all modules in forks of this process, which has imported the compiler."""
    compiler = importlib.import_module("rcopterx.compiling.compiled")
    compiler.Announcer.announced = True
    fork = multiprocessing.get_context("fork")
    try:
        with ProcessPoolExecutor(os.cpu_count(), fork, _end_by_interrupt) as pool:
            # The forks are all begun here; Ctrl-C waits until each of them ends by it without a word.
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            futures = [pool.submit(_compile_module, module) for module in MODULES]
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            return [future.result() for future in futures]  # `map` would cancel them while they end
    except BrokenProcessPool as error:
        return [_Result(str(error))]


def _end_by_interrupt() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _compile_module(module: str) -> _Result:
    from rcopterx.compiling.compiled import Announcer

    try:
        importlib.import_module(f"rcopterx.{module}")
    except Exception:  # noqa: BLE001 - the compiler raises errors of many kinds
        return _Result(f"{module}: {traceback.format_exc().strip()}")
    return _Result(not_kept=Announcer.not_kept)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
