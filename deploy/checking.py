"""Checks a fleet in a process that ends: what only agents need stays out of the one that launches them."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.snapshot import write_snapshot

MODULE: Final = "rcopterx.deploy.fleet_check"
EXIT_WRONG: Final = 3
"""Exit code that says that a field of the fleet is wrong."""


def check_apart(fleet: FleetFile, directory: Path, forks: ForkServer) -> None:
    """`fleet_check.check_fleet` in a process of its own.

    Parameters
    ----------
    fleet, directory
        The fleet and its run directory.
    forks
        Starts the process; what it has imported for the fleet need not be imported for the check.

    Raises
    ------
    FleetError
        Names the field that is wrong.
    OSError
        It cannot be checked; says why.
    """
    with TemporaryDirectory(prefix="rcopterx-") as place:
        snapshot, log = Path(place) / "fleet.json", Path(place) / "log"
        write_snapshot(fleet, snapshot)
        code = forks.start([sys.executable, "-m", MODULE, str(snapshot), str(directory)], log).process.wait()
        told = log.read_text(encoding="utf-8", errors="replace").strip()
    if code == EXIT_WRONG:
        raise FleetError(told)
    if code:
        raise OSError(f"the fleet cannot be checked, exit code {code}: {told}")
