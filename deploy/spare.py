"""A spare agent process: everything imported, every pilot built, waiting to replace an agent that died.

Starting an interpreter and importing numerical libraries takes longer than a vehicle can be bridged by the
inputs of its last plan; taking over in a warm process does not.
"""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

from agents.process import run_agent
from deploy.fleet import load_fleet
from deploy.role_settings import pilot_of
from deploy.roles import end_with_parent, run_reporting
from deploy.spare_agent import READY


def wait_for_job(fleet_path: Path, vehicles: list[str]) -> Callable[[], None] | None:
    """Prepare the agents of these vehicles, wait for a job on standard input.

    Returns
    -------
    callable or None
        Runs the agent; None when the supervisor closed the pipe instead.
    """
    fleet = load_fleet(fleet_path)
    prepared = {name: pilot_of(fleet, name) for name in vehicles}
    os.write(sys.stdout.fileno(), READY)
    line = sys.stdin.readline()
    if not line:
        return None
    order = json.loads(line)
    log = os.open(order["log"], os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    for descriptor in (sys.stdout.fileno(), sys.stderr.fileno()):
        os.dup2(log, descriptor)
    vehicle = order["vehicle"]
    return lambda: run_agent(*prepared[vehicle])


def main() -> None:
    """Entry point: `python -m deploy.spare FLEET_FILE VEHICLE...`."""
    end_with_parent()
    run = wait_for_job(Path(sys.argv[1]), sys.argv[2:])
    if run is not None:
        run_reporting(run)


if __name__ == "__main__":
    main()
