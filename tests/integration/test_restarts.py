"""Processes that everybody depends on are killed in flight, and nobody has to come down for it."""

import os
import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from integration_support import NAMES, Flying, Truth, transmitter_state

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]

ROOT = Path(__file__).parents[2]


def pids_named(title: str) -> set[int]:
    """Processes that go by exactly this name, of any fleet on this computer."""
    done = subprocess.run(["pgrep", "-xf", title], capture_output=True, text=True, timeout=10)
    return {int(line) for line in done.stdout.split()}


@pytest.mark.parametrize("victim", ["router", "tracker"])
def test_the_fleet_flies_on_when_its_router_or_vicon_gateway_is_killed(launch: Launch, victim: str) -> None:
    flying = launch(control='controller = "cascade"\nhorizon = 30')
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    flying.fleet.wait_for_formation()
    truth.start_watch()
    flying.wait_for_spare(victim)
    flying.kill(victim)
    flying.fleet.wait_until(lambda: flying.restarts(victim) == 1, 10, f"{victim} is not started again")
    plan = flying.fleet["h1"].plan
    assert plan is not None
    flying.fleet.wait_until(
        lambda: (
            all(transmitter_state(flying, name) == "armed" for name in NAMES)
            and all(flying.fleet.state_of(name).phase == "flying" for name in NAMES)
            and flying.fleet["h1"].plan is not plan
        ),
        15,
        "not flying again",
        NAMES,
    )
    flying.fleet["h1"].go_to((0.2, 0.0, 1.0))
    flying.fleet.wait_for_arrival(["h1"])
    flying.fleet.wait_for_formation()
    truth.assert_nobody_touched_down()


def test_an_agent_goes_by_its_name_and_can_be_killed_by_it_again_after_a_spare_took_over(
    launch: Launch,
) -> None:
    example = re.search(r'^pkill -9 -xf "(.+)"$', (ROOT / "README.md").read_text("utf-8"), re.MULTILINE)
    assert example is not None
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    flying.fleet.wait_for_formation()
    truth.start_watch()
    for restarts in (1, 2):
        flying.wait_for_spare("agent-h2")
        pid = flying.pid("agent-h2")
        assert pid in pids_named(example[1])
        os.kill(pid, signal.SIGKILL)
        flying.fleet.wait_until(
            lambda restarts=restarts: flying.restarts("agent-h2") == restarts,  # type: ignore[misc]
            10,
            "h2 is not started again",
        )
    flying.fleet.wait_until(lambda: flying.pid("agent-h2") in pids_named(example[1]), 10, "no name")
    flying.fleet.wait_for_formation()
    truth.assert_nobody_touched_down()
