"""Run everything that must pass: fleets of real processes, and the unit tests beside them.

Fleets leave much of two cores unused. The unit tests run in what they leave, at the lowest priority, so that
they delay no fleet, in two processes that end together. Lines are printed at once, failed tests again at the
end; the exit code is 1 if a run fails. A run that hangs prints its threads and fails; a run that leaves
processes behind fails, too.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Thread

TESTS = Path(__file__).parent
# pytest cuts the reason of a failure off at the width of the terminal.
SUMMARY_COLUMNS = "200"
PYTEST = (sys.executable, "-u", "-X", "faulthandler", "-m", "pytest", "--durations=10", "--color=no")
LIMIT_S = 1800.0
"""Several times the usual length: such a run hangs outside the time limit of a test."""
LAST_LINES_S = 10.0
"""For the last output of a run."""
FILES = sorted(TESTS.rglob("test_*.py"))
# Importing all the others would take ten seconds, in which no fleet flies.
FILES_WITH_FLEETS = [path for path in FILES if "mark.integration" in path.read_text(encoding="utf-8")]
SHARED = ("-n", "2", "--dist", "loadfile", "--no-loadscope-reorder", "--timeout", "600")
RUNS = {
    "fleets": (*PYTEST, "-m", "integration and not campaign", *map(str, FILES_WITH_FLEETS)),
    "units": ("nice", "-n", "19", *PYTEST, *SHARED, "-m", "not integration and not campaign", str(TESTS)),
}


class Run:
    """One run of pytest, whose lines are printed with its name."""

    def __init__(self, name: str, command: tuple[str, ...]) -> None:
        self.name = name
        self.seconds = 0.0
        self.broken: list[str] = []
        self._begun_s = time.monotonic()
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | {"COLUMNS": SUMMARY_COLUMNS},
        )
        self._thread = Thread(target=self._print, daemon=True)
        self._thread.start()

    def _print(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            print(f"{self.name:6} | {line}", end="", flush=True)
            if line.startswith(("FAILED ", "ERROR ")):
                self.broken.append(line.rstrip())

    def wait(self) -> bool:
        """Whether all tests of the run passed."""
        try:
            self._process.wait(max(0.0, self._begun_s + LIMIT_S - time.monotonic()))
        except subprocess.TimeoutExpired:
            self._end()
        self.seconds = time.monotonic() - self._begun_s
        self._thread.join(LAST_LINES_S)
        if self._thread.is_alive():
            self.broken.append(f"ERROR processes were left behind: {', '.join(self._left_behind())}")
        return self._process.returncode == 0 and not self._thread.is_alive()

    def _end(self) -> None:
        """End a run that hangs; it prints where each of its threads is."""
        self.broken.append(f"ERROR not ended after {LIMIT_S / 60:.0f} min")
        self._process.send_signal(signal.SIGABRT)
        try:
            self._process.wait(LAST_LINES_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _left_behind(self) -> list[str]:
        """Processes that hold the output pipe of this run."""
        assert self._process.stdout is not None
        pipe = os.fstat(self._process.stdout.fileno()).st_ino
        return [
            f"{process.name} ({' '.join(_command(process))[:80]})"
            for process in Path("/proc").iterdir()
            if process.name.isdigit() and process.name != str(os.getpid()) and _holds(process, pipe)
        ]


def _command(process: Path) -> list[str]:
    try:
        return (process / "cmdline").read_text(errors="replace").split("\0")
    except OSError:
        return []


def _holds(process: Path, pipe: int) -> bool:
    """Whether a process has a descriptor of a pipe."""
    try:
        return any(os.readlink(held) == f"pipe:[{pipe}]" for held in (process / "fd").iterdir())
    except OSError:
        return False  # It has ended.


def main() -> int:
    """Run all and show their durations."""
    # A background job of a shell ignores Ctrl-C, and its children inherit that; some tests send it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Fleets would wait for unit tests that compile the kernels at the lowest priority.
    subprocess.run([sys.executable, "-m", "rcopterx.compiling"], check=True)
    runs = [Run(name, command) for name, command in RUNS.items()]
    passed = {run.name: run.wait() for run in runs}
    for run in runs:
        verdict = "passed" if passed[run.name] else "FAILED"
        print("".join(f"{line}\n" for line in run.broken), end="")
        print(f"{run.name}: {verdict}, {run.seconds / 60:.1f} min")
    return 0 if all(passed.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
