"""A process that hangs in flight is replaced like one that died, and no vehicle comes down for it."""

import os
import re
import signal

import pytest
from integration_support import NAMES, Flying, Truth, fly_to, transmitter_state

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

VICTIMS = ("agent-h2", "transmitters")
"""The others hang in test_flown_faults.py."""


def hang(flying: Flying, process: str) -> None:
    """Stop a process for good and wait until all vehicles are flown again."""
    children = flying.launcher_of(process).supervisor.children
    flying.wait_for_spare(process)
    before = children[process].hung, children[process].restarts
    os.kill(flying.pid(process), signal.SIGSTOP)
    flying.fleet.wait_until(
        lambda: (children[process].hung, children[process].restarts) == (before[0] + 1, before[1] + 1),
        30,
        f"{process} hangs on",
    )
    plans = [flying.fleet[name].plan for name in NAMES]
    flying.fleet.wait_until(
        lambda: all(
            transmitter_state(flying, name) == "armed"
            and flying.fleet.state_of(name).phase == "flying"
            and flying.fleet[name].plan is not plan
            for name, plan in zip(NAMES, plans, strict=True)
        ),
        30,
        f"not flown again after {process} hung",
        NAMES,
    )


def hang_spare(flying: Flying) -> None:
    """Stop a process that waits to replace others; it is replaced as well."""
    supervisor = flying.launcher_of("router").supervisor
    flying.fleet.wait_until(lambda: supervisor.spares.complete, 30, "spare processes are missing")
    spare, hung = next(iter(supervisor.spares.processes)), supervisor.spares_hung
    os.kill(spare, signal.SIGSTOP)
    flying.fleet.wait_until(
        lambda: (
            supervisor.spares_hung == hung + 1
            and supervisor.spares.ready() > 0
            and spare not in supervisor.spares.processes
        ),
        30,
        "the spare hangs on",
    )


def test_all_fly_on_whichever_process_hangs_and_hangs_are_reported(flying: Flying, truth: Truth) -> None:
    for victim in VICTIMS:
        hang(flying, victim)
    hang_spare(flying)
    fly_to(flying, truth, (0.2, 0.0, 0.9))
    truth.assert_none_touched_down()
    events = "; ".join(flying.launcher_of("router").events)
    assert all(f"{victim}: hung: no progress for" in events for victim in VICTIMS)
    flying.fleet.wait_until(
        lambda: any(re.search(r"agent-h2 \d+ \([1-9]\d* hung\)", note) for note in flying.fleet.notes()),
        30,
        "not in the status",
    )
