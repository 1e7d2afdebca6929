"""A helicopter, a Crazyflie and a quadrotor with an autopilot in one formation, with real processes."""

from collections.abc import Callable

import pytest
from integration_support import NAMES, Flying, Truth, fly_to, landed_gently, of_types
from radio_support import kill_gateway_in_flight, module
from support.udp import udp_paths

from rcopterx.ground_station.terminal.scenario import inject_faults
from rcopterx.simulator.faults import BreakRadio, Recover

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]
TYPES = {"h1": "coaxial", "h2": "crazyflie", "h3": "mavlink_quadrotor"}


def test_three_families_fly_a_formation_and_an_autopilot_lands_by_itself_when_its_radio_is_gone(
    launch: Launch,
) -> None:
    flying = launch(of_types(TYPES, ("radio-h1", *udp_paths(2))))
    fleet, truth = flying.fleet, Truth(flying)
    fleet.wait_until(lambda: "16.80 V, link 100 %" in module(flying, "h3"), 30, "no battery")
    fleet.take_off(NAMES, height_m=0.7, timeout_s=40)
    fleet.wait_for_formation()
    truth.start_watch()
    fly_to(flying, truth, (0.3, 0.2, 0.9))

    kill_gateway_in_flight(flying)
    fly_to(flying, truth, (-0.2, 0.1, 0.8))
    truth.assert_none_touched_down()

    inject_faults(fleet.session, BreakRadio("h3", "unplugged"))
    fleet.wait_until(lambda: landed_gently(truth, "h3"), 30, "h3 has not landed")
    inject_faults(fleet.session, Recover())
    fleet.wait_until(lambda: module(flying, "h3").startswith("ready"), 30, "h3 is not ready again")
    fleet.land(["h1", "h2"])
    fleet.wait_until(lambda: all(landed_gently(truth, name) for name in ("h1", "h2")), 30, "not landed")
