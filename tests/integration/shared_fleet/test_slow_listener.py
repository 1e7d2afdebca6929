"""A slow listener, such as a ground station that hangs, does not disturb the fleet."""

import os
import signal
import subprocess
import sys

import pytest
from integration_support import NAMES, Flying, Truth, at, fallbacks, flown_by, in_formation

from rcopterx.deploy.roles.addresses import bus_address

pytestmark = [pytest.mark.integration, pytest.mark.timeout(120)]

TICKS = 120
LATE_SHARE = 0.5
"""A busy machine delays a frame now and then, a congested bus most of them."""

LISTENER = """
import sys, threading
from rcopterx.bus.session import BusAddress, Session
heard = threading.Semaphore(0)
with Session(BusAddress(tuple(sys.argv[3:]), sys.argv[1], sys.argv[2]), timeout_s=10) as session:
    session.tap(lambda *_: heard.release())
    for _ in range(500):
        heard.acquire()
    print("listening", flush=True)
    threading.Event().wait()  # until it is killed
"""


def test_a_listener_that_hangs_does_not_delay_the_fleet(flying: Flying, truth: Truth) -> None:
    address = bus_address(flying.fleet.file, "main")
    words = [sys.executable, "-c", LISTENER, address.fleet, str(address.namespace), *address.endpoints]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as listener:
        try:
            assert listener.stdout is not None
            assert listener.stdout.readline() == "listening\n"
            begun = {name: ticks(flying, name) for name in NAMES}
            late = {name: fallbacks(flying, name, "pose_extrapolated") for name in NAMES}
            os.kill(listener.pid, signal.SIGSTOP)
            flying.fleet.wait_until(
                lambda: all(ticks(flying, name) > begun[name] + TICKS for name in NAMES), 15, "ticks stop"
            )
            assert at(truth, "h1", (0.0, 0.0, 0.8), 0.2)
            assert in_formation(flying, truth, 0.2)
        finally:
            listener.kill()
    truth.assert_none_touched_down()
    for name in NAMES:
        assert flown_by(flying, name) is not None
        delayed = fallbacks(flying, name, "pose_extrapolated") - late[name]
        assert delayed <= LATE_SHARE * (ticks(flying, name) - begun[name])


def ticks(flying: Flying, name: str) -> int:
    agent = flying.fleet.state_of(name).agent
    return 0 if agent is None else agent.diagnostics.ticks
