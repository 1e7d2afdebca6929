"""Warnings about margins from a process that ends: what they take stays out of the one that launches."""

import subprocess
import sys

from rcopterx.deploy.fleet_file.schema import FleetFile
from rcopterx.deploy.fleet_file.snapshot import encoded
from rcopterx.deploy.forking import child_environment


def warnings_apart(fleet: FleetFile) -> list[str]:
    """`margins.configured_warnings` in a process of its own; a line that says why if it cannot tell them."""
    done = subprocess.run(
        [sys.executable, "-m", "rcopterx.ground_station.margins"],
        input=encoded(fleet),
        capture_output=True,
        env=child_environment(),
        check=False,
        start_new_session=True,  # Ctrl-C is for the fleet
    )
    if done.returncode:
        return [f"margins are not known: {done.stderr.decode(errors='replace').strip()}"]
    return done.stdout.decode().splitlines()
