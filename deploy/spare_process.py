"""The supervisor's side of the spare process."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

READY = b"ready\n"

Job = tuple[str, str]
"""Role and unit of a process."""


def child_environment() -> dict[str, str]:
    """Environment of supervised processes: one thread per numerical library, and who the parent is."""
    return os.environ | {
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "RCOPTERX_PARENT": str(os.getpid()),
    }


class SpareProcess:
    """At most one spare process for what must be back at once on this host.

    Parameters
    ----------
    snapshot
        Snapshot of the fleet file handed to the spare.
    jobs
        Roles and units it must be able to take over; none means that there is never a spare.
    log
        Log file of the spare until it takes over.
    """

    def __init__(self, snapshot: Path, jobs: Sequence[Job], log: Path) -> None:
        self._snapshot = snapshot
        self._jobs = tuple(jobs)
        self._log = log
        self._process: subprocess.Popen[bytes] | None = None
        self._heard = b""

    def prepare(self) -> None:
        """Start the spare if there is none."""
        if self._process is not None and self._process.poll() is None:
            return
        if not self._jobs:
            return
        self.close()
        self._heard = b""
        words = [f"{role}:{unit}" for role, unit in self._jobs]
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "deploy.spare", str(self._snapshot), *words],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                start_new_session=True,
                env=child_environment(),
            )
        if self._process.stdout is not None:
            os.set_blocking(self._process.stdout.fileno(), False)

    def take(self, role: str, unit: str, log: Path) -> subprocess.Popen[bytes] | None:
        """Let the spare take over a job; None if that is none of its jobs or it is not ready."""
        process = self._process
        if (role, unit) not in self._jobs or process is None or process.stdin is None or not self.ready():
            return None
        try:
            process.stdin.write((json.dumps({"role": role, "unit": unit, "log": str(log)}) + "\n").encode())
            process.stdin.close()
        except BrokenPipeError:
            return None
        self._process = None
        return process

    def ready(self) -> bool:
        """Whether the spare could take over at this moment."""
        process = self._process
        if process is None or process.poll() is not None or process.stdout is None:
            return False
        self._heard += process.stdout.read() or b""
        return self._heard.startswith(READY)

    def close(self) -> None:
        """End the spare."""
        if self._process is None:
            return
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._process = None
