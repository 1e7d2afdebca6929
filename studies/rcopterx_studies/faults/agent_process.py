"""The process of a vehicle's agent, to end it on purpose."""

import os
import signal
from pathlib import Path

from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.fleet.schema import FleetError, FleetFile

PROCESSES = Path("/proc")


def kill_agent(file: FleetFile, vehicle: str) -> int:
    """End the agent of a vehicle at once, as a crash would; return the number of its process.

    Only processes that write to the log of this fleet of this user count, so those of other fleets go on.
    Raises `FleetError`: no such process runs on this computer.
    """
    log = run_directory(file.name, file.bus.namespace) / "log" / f"agent-{vehicle}.log"
    for process in PROCESSES.iterdir():
        try:
            title = (process / "cmdline").read_bytes().rstrip(b"\0 ").decode(errors="replace")
            if title == f"rcopterx agent {vehicle}" and (process / "fd" / "1").readlink() == log:
                os.kill(int(process.name), signal.SIGKILL)
                return int(process.name)
        except OSError:
            continue  # it is no process, has ended, or belongs to another user
    raise FleetError(f"{file.name}: no agent of {vehicle} runs on this computer")
