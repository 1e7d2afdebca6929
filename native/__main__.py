"""`python -m rcopterx.native`: compile all kernels, so that what starts later finds them."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

from rcopterx.native.cache import COMPLETE, MODULES, directory, remove_unused


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
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        outputs = list(pool.map(_compiled, MODULES))
    problems = [output for output in outputs if output is not None]
    if problems:
        print(*problems, sep="\n", file=sys.stderr)
        return 1
    (path / COMPLETE).touch()
    remove_unused(path.parent)
    print(f"... compiled in {time.monotonic() - start_s:.0f} s", file=sys.stderr)
    return 0


def _compiled(module: str) -> str | None:
    """Compile a module in a process of its own; what the process said if it could not."""
    command = [sys.executable, "-c", f"import rcopterx.native.{module}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return f"{module}: {done.stderr.strip()}" if done.returncode else None


if __name__ == "__main__":
    sys.exit(main())
