"""Warnings about margins from a process of their own, so that a launcher needs no numerical libraries."""

import sys

from rcopterx.deploy.processes.background import start_in_background
from rcopterx.fleet.reading import encoded
from rcopterx.fleet.schema import FleetFile


def warnings_apart(fleet: FleetFile) -> list[str]:
    """`margins.configured_warnings` from another process; a line with the reason if it fails."""
    try:
        with start_in_background(
            [sys.executable, "-m", "rcopterx.ground_station.terminal.margins"]
        ) as process:
            output, complaint = process.communicate(encoded(fleet))
    except OSError as error:
        return [f"margins are not known: {error}"]
    if process.returncode:
        return [f"margins are not known: {complaint.decode(errors='replace').strip()}"]
    return output.decode().splitlines()
