"""A spare: a process with all imports and pilots, ready to replace one that dies in flight at once."""

import json
import os
import select
import sys
from collections.abc import Sequence
from pathlib import Path

from rcopterx.bus.heartbeat import LONGEST_WAIT_S, own_heartbeat
from rcopterx.deploy.roles.agent import fly, ready_pilot
from rcopterx.deploy.roles.run import begin_role, end_with_parent, name_process, run_reporting, runner
from rcopterx.fleet.reading import load_fleet


def run_next_job(snapshot: Path, host: str, jobs: Sequence[tuple[str, str]]) -> None:
    """Prepare for jobs (role, unit) and run the one that standard input names, none at its end."""
    name_process("spare")
    fleet = load_fleet(snapshot)
    pilots = {unit: ready_pilot(fleet, unit, host) for role, unit in jobs if role == "agent"}
    runners = {role: runner(role) for role, _ in jobs if role != "agent"}
    if not (line := _read_order()):
        return
    order = json.loads(line)
    log = os.open(order["log"], os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    os.dup2(log, sys.stdout.fileno())
    os.dup2(log, sys.stderr.fileno())
    role, unit = order["role"], order["unit"]
    begin_role(role, unit)
    if role == "agent":
        fly(*pilots[unit], take_over=order["take_over"])
    else:
        runners[role](fleet, unit)


def _read_order() -> str:
    """Wait for a line on standard input; beats show meanwhile that this process would react."""
    heartbeat = own_heartbeat()
    heartbeat.beat()
    while not select.select([sys.stdin], [], [], LONGEST_WAIT_S)[0]:
        heartbeat.beat()
    heartbeat.starting()
    return sys.stdin.readline()


def main() -> None:
    """Entry point: `python -m rcopterx.deploy.spares.spare SNAPSHOT HOST ROLE:UNIT...`."""
    end_with_parent()
    jobs = [(role, unit) for role, _, unit in (word.partition(":") for word in sys.argv[3:])]
    run_reporting(lambda: run_next_job(Path(sys.argv[1]), sys.argv[2], jobs))


if __name__ == "__main__":
    main()
