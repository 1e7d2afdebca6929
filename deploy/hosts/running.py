"""Which fleets are up on this computer: every router keeps a record of its fleet, locked while it runs.

The lock ends with the process, however it ends, so that a record of a fleet that is down misleads nobody.
`rcopterx kill` reads records before it does anything else: nothing here takes long to import.
"""

import fcntl
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from rcopterx.deploy.hosts.run_directory import base_directory

LOCK_PATIENCE_S = 2.0
"""How long a router that replaces another one waits for the lock."""
LOCK_RETRY_S = 0.01


class RunningFleet(NamedTuple):
    """What a router says of its fleet.

    Attributes
    ----------
    fleet
        Name of the fleet.
    digest
        Digest of its fleet file.
    namespace
        Of the bus.
    host
        Host of the fleet file that this computer is.
    endpoints
        Where the router of this host listens.
    others
        Endpoints of the routers of the other hosts.
    vehicles
        All vehicles of the fleet file.
    snapshot
        Snapshot of the fleet file.
    credentials
        Fields of `rcopterx.bus.endpoints.Credentials`, for routers that ask for a certificate.
    """

    fleet: str
    digest: str
    namespace: str | None
    host: str
    endpoints: list[str]
    others: list[str]
    vehicles: list[str]
    snapshot: str
    credentials: list[str] | None = None


@contextmanager
def recorded(directory: Path, running: RunningFleet) -> Iterator[None]:
    """Keep the record of a running fleet in its run directory.

    Raises
    ------
    OSError
        Another router keeps it already.
    """
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
            # The one before may have removed the file between opening and locking it.
            if path.exists() and os.stat(path).st_ino == os.fstat(descriptor).st_ino:
                return descriptor
        except BlockingIOError:
            pass
        os.close(descriptor)
        if time.monotonic() > give_up_s:
            raise OSError(f"{path}: another router of this fleet is running")
        time.sleep(LOCK_RETRY_S)


def running_fleets(base: Path | None = None) -> list[RunningFleet]:
    """Fleets that are up on this computer, by their run directories.

    Parameters
    ----------
    base
        Where to look; by default `base_directory`.
    """
    found = []
    for path in sorted((base or base_directory()).glob("*/up-*.json")):
        running = _read(path)
        if running is not None:
            found.append(running)
    return found


def _read(path: Path) -> RunningFleet | None:
    """The record of a router that runs, else None."""
    try:
        with path.open("rb") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return RunningFleet(**json.load(file))
    except (OSError, ValueError, TypeError):
        # Removed, or not written completely, in this very moment: its fleet is just going down or coming up.
        return None
    return None
