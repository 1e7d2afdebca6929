"""Processes that everybody depends on are killed in flight, and nobody has to come down for it."""

from collections.abc import Callable

import pytest
from integration_support import NAMES, Flying, Truth, transmitter_state

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]


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
