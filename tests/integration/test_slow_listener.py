"""A listener that does not read disturbs nobody: a ground station that hangs, a notebook put to sleep."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable

import pytest
from integration_support import NAMES, Flying, Truth, transmitter_state

from deploy.roles.addresses import bus_address

pytestmark = [pytest.mark.integration, pytest.mark.timeout(120)]

Launch = Callable[..., Flying]

LATE_FRAMES = 12
"""Of 250 while the listener hangs: a busy machine delays one now and then, a congested bus most of them."""

LISTENER = """
import sys, threading
from bus.session import BusAddress, Session
heard = threading.Semaphore(0)
with Session(BusAddress(tuple(sys.argv[3:]), sys.argv[1], sys.argv[2]), timeout_s=10) as session:
    session.tap(lambda *_: heard.release())
    for _ in range(500):
        heard.acquire()
    print("listening", flush=True)
    threading.Event().wait()  # until it is killed
"""


def test_a_listener_that_hangs_does_not_delay_the_fleet(launch: Launch) -> None:
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    truth.start_watch()
    address = bus_address(flying.fleet.file, "main")
    words = [sys.executable, "-c", LISTENER, address.fleet, str(address.namespace), *address.endpoints]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as listener:
        try:
            assert listener.stdout is not None
            assert listener.stdout.readline() == "listening\n"
            ticks = {name: _ticks(flying, name) for name in NAMES}
            late = {name: _extrapolated(flying, name) for name in NAMES}
            os.kill(listener.pid, signal.SIGSTOP)
            flying.fleet.wait_until(
                lambda: all(_ticks(flying, name) > ticks[name] + 250 for name in NAMES), 15, "ticks stop"
            )
        finally:
            listener.kill()
    truth.assert_nobody_touched_down()
    for name in NAMES:
        status = flying.fleet.state_of(name).transmitter
        assert status is not None
        assert transmitter_state(flying, name) == "armed"
        assert {kind: n for kind, n in status.counters.items() if "HOLD" in kind or "DESCEND" in kind} == {}
        assert _extrapolated(flying, name) - late[name] <= LATE_FRAMES


def _extrapolated(flying: Flying, name: str) -> int:
    agent = flying.fleet.state_of(name).agent
    return 0 if agent is None else agent.diagnostics.fallbacks.get("pose_extrapolated", 0)


def _ticks(flying: Flying, name: str) -> int:
    agent = flying.fleet.state_of(name).agent
    return 0 if agent is None else agent.diagnostics.ticks
