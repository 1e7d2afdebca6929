"""A spare process: everything imported, every pilot built, waiting to replace a process that died in flight.

Starting an interpreter and importing numerical libraries takes longer than a vehicle can be bridged by the
inputs of its last plan; taking over in a warm process does not.
"""

import json
import os
import select
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from rcopterx.bus.heartbeat import LONGEST_WAIT_S, own_heartbeat
from rcopterx.deploy.processes.prepared import fleet_of
from rcopterx.deploy.processes.process_log import set_up
from rcopterx.deploy.roles.agent import fly, ready_pilot
from rcopterx.deploy.roles.run import end_with_parent, log_start, name_process, run_reporting, runner
from rcopterx.deploy.spares.spare_process import Job


def wait_for_job(snapshot: Path, host: str, jobs: Sequence[Job]) -> Callable[[], None] | None:
    """Prepare these jobs, wait for one of them on standard input.

    Returns
    -------
    callable or None
        Does the job; None when the supervisor closed the pipe instead.
    """
    name_process("spare")
    fleet = fleet_of(snapshot)
    pilots = {unit: ready_pilot(fleet, unit, host or None) for role, unit in jobs if role == "agent"}
    runners = {role: runner(role) for role, _ in jobs if role != "agent"}
    line = _order()
    if not line:
        return None
    order = json.loads(line)
    log = os.open(order["log"], os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    for descriptor in (sys.stdout.fileno(), sys.stderr.fileno()):
        os.dup2(log, descriptor)
    role, unit = order["role"], order["unit"]
    name_process(role, unit)
    log_start(role, unit)
    if role == "agent":
        return lambda: fly(*pilots[unit], take_over=order["take_over"])
    return lambda: runners[role](fleet, unit)


def _order() -> str:
    """The line that says what to do; while there is none, beats show that it would be heard."""
    heartbeat = own_heartbeat()
    heartbeat.beat()
    while not select.select([sys.stdin], [], [], LONGEST_WAIT_S)[0]:
        heartbeat.beat()
    heartbeat.starting()
    return sys.stdin.readline()


def main() -> None:
    """Entry point: `python -m rcopterx.deploy.spares.spare SNAPSHOT HOST ROLE:UNIT...`."""
    end_with_parent()
    set_up()
    jobs = [(role, unit) for role, _, unit in (word.partition(":") for word in sys.argv[3:])]
    run = wait_for_job(Path(sys.argv[1]), sys.argv[2], jobs)
    if run is not None:
        run_reporting(run)


if __name__ == "__main__":
    main()
