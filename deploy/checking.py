"""Checks a fleet in a process that ends: what only agents need stays out of the one that launches them."""

import subprocess
import sys
from pathlib import Path
from typing import Final

from rcopterx.deploy.fleet_file.schema import FleetError, FleetFile
from rcopterx.deploy.fleet_file.snapshot import encoded
from rcopterx.deploy.forking import child_environment

EXIT_WRONG: Final = 3
"""Exit code that says that a field of the fleet is wrong."""


def check_apart(fleet: FleetFile, directory: Path) -> None:
    """`fleet_check.check_fleet` in a process of its own.

    Parameters
    ----------
    fleet, directory
        The fleet and its run directory.

    Raises
    ------
    FleetError
        Names the field that is wrong.
    OSError
        It cannot be checked; says why.
    """
    command = [sys.executable, "-m", "rcopterx.deploy.fleet_check", str(directory)]
    done = subprocess.run(
        command, input=encoded(fleet), stderr=subprocess.PIPE, env=child_environment(), check=False
    )
    told = done.stderr.decode(errors="replace").strip()
    if done.returncode == EXIT_WRONG:
        raise FleetError(told)
    if done.returncode:
        raise OSError(f"the fleet cannot be checked, exit code {done.returncode}: {told}")
