"""Time from a request to kill until motors stop, of every family of vehicles, over many kills in the air."""

from collections.abc import Callable, Sequence
from random import Random

import numpy as np
import pytest
from integration_support import NAMES, Flying, not_killed, of_types, transmitter_state
from radio_support import RadioLog, module
from support.radio_addresses import radio_paths
from support.udp import udp_paths

from rcopterx.simulator.faults import BreakRadio, Recover
from rcopterx_studies.faults.scenario import inject_faults

pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(900)]

Launch = Callable[..., Flying]
ROUNDS = 17  # with a kill of each of three vehicles
UNTHRUSTED_US = 1110.0
HEIGHT_M = 0.3
FRAME_S = 0.02
STOPPED_S = 1.0
"""Very loose, for a busy machine; docs/crazyflie.md has measured times."""
PORTS: dict[str, Callable[[], Sequence[str]]] = {
    "crazyflie": lambda: radio_paths(3),
    "mavlink_quadrotor": lambda: udp_paths(3),
    "coaxial": lambda: [f"radio-{name}" for name in NAMES],
}
AIR_S = {"crazyflie": 0.0, "mavlink_quadrotor": 0.0, "coaxial": 0.022}
"""Longest time from the end of a frame at the radio module to the vehicle; others note what vehicles get."""


def killed(flying: Flying, log: RadioLog, name: str) -> float:
    """Kill a vehicle; return when the first frame without thrust arrived, after the request [s]."""
    assert log.frames(name)[-1][1] >= UNTHRUSTED_US, "the motors stand already"
    requested_s = flying.now_s()
    flying.fleet[name].kill()

    def stopped() -> list[float]:
        return [at_s for at_s, us in log.frames(name) if at_s > requested_s and us < UNTHRUSTED_US]

    flying.fleet.wait_until(lambda: bool(stopped()), 30, "the motors turn", [name])
    return stopped()[0] - requested_s


def made_ready(flying: Flying, kind: str) -> None:
    """Reset the kills; a Crazyflie is also switched off and on."""
    fleet = flying.fleet
    # A kill is not reset while a command from before it asks for thrust.
    fleet.wait_until(lambda: all(not_killed(flying, name) for name in NAMES), 30, "still killed")
    if kind == "crazyflie":
        for name in NAMES:
            inject_faults(fleet.session, BreakRadio(name, "off"))
        fleet.wait_until(lambda: all("silent" in module(flying, name) for name in NAMES), 30, "still on")
        inject_faults(fleet.session, Recover())
    fleet.wait_until(
        lambda: all(transmitter_state(flying, name) == "disarmed" for name in NAMES), 30, "still killed"
    )


@pytest.mark.parametrize("kind", PORTS)
def test_a_kill_stops_motors_at_once(launch: Launch, kind: str) -> None:
    flying = launch(of_types(dict.fromkeys(NAMES, kind), PORTS[kind]()))
    log, moments, times_s = RadioLog(flying), Random(1), []
    for _ in range(ROUNDS):
        flying.fleet.take_off(NAMES, height_m=HEIGHT_M, timeout_s=60)
        for name in NAMES:
            flying.fleet.wait(moments.uniform(0.0, FRAME_S))
            times_s.append(killed(flying, log, name) + AIR_S[kind])
        made_ready(flying, kind)
    median_ms, most_ms, longest_ms = 1000 * np.percentile(times_s, (50, 99, 100))
    print(
        f"{kind}: motors stopped after {len(times_s)} requests to kill: median {median_ms:.1f} ms, "
        f"99 % {most_ms:.1f} ms, longest {longest_ms:.1f} ms"
    )
    assert most_ms < 1000 * STOPPED_S
