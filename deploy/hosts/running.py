"""Records of the fleets that are up on this computer, which routers keep locked; read quickly by `kill`."""

import fcntl
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from rcopterx.deploy.hosts.run_directory import base_directories
from rcopterx.places import is_locked

LOCK_PATIENCE_S = 2.0  # how long a router that replaces another one waits for the lock
LOCK_RETRY_S = 0.01


class RunningFleet(NamedTuple):
    """Record of a running fleet."""

    fleet: str
    digest: str  # digest of the fleet file
    namespace: str | None  # namespace of the bus
    host: str  # host of the fleet file that this computer is
    endpoints: list[str]  # endpoints of the router of this host
    others: list[str]  # endpoints of the routers of the other hosts
    vehicles: list[str]
    snapshot: str  # path of the snapshot of the fleet file
    credentials: list[str] | None = None  # `Credentials`, for routers that require a certificate


@contextmanager
def recorded(directory: Path, running: RunningFleet) -> Iterator[None]:
    """Keep the record of a running fleet while the context lasts; `OSError` if another router runs."""
    path = directory / f"up-{running.host}.json"
    descriptor = _locked(path)
    try:
        os.truncate(descriptor, 0)
        os.write(descriptor, json.dumps(running._asdict()).encode())
        yield
        path.unlink(missing_ok=True)
    finally:
        os.close(descriptor)


def _locked(path: Path) -> int:
    give_up_s = time.monotonic() + LOCK_PATIENCE_S
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # A predecessor may have removed the file between opening and locking it.
            if path.exists() and os.stat(path).st_ino == os.fstat(descriptor).st_ino:
                return descriptor
        except BlockingIOError:
            pass
        os.close(descriptor)
        if time.monotonic() > give_up_s:
            raise OSError(f"{path}: another router of this fleet is running")
        time.sleep(LOCK_RETRY_S)


def running_fleets() -> list[RunningFleet]:
    """Return the fleets that are up, from their run directories in all `base_directories`."""
    paths = sorted(path for base in base_directories() for path in base.glob("*/up-*.json"))
    return [running for path in paths if (running := _read(path)) is not None]


def _read(path: Path) -> RunningFleet | None:
    """Return the record of a running router, else None."""
    try:
        with path.open("rb") as file:
            return RunningFleet(**json.load(file)) if is_locked(file) else None
    except (OSError, ValueError, TypeError):
        # The fleet is just going down or coming up: its record is removed or incomplete.
        return None
