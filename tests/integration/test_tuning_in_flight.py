"""Controllers, estimators, weights and horizons change in flight, with real processes."""

from collections.abc import Callable

import pytest
from integration_support import Flying, Truth, fleet_text, free_port

from ground_station.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]


def cascade_fleet() -> str:
    hosts = {"main": ("127.0.0.1", free_port())}
    return fleet_text(free_port(), hosts, control='controller = "cascade"\nhorizon = 30')


def test_everything_can_be_tuned_in_flight_and_survives_a_restart_of_the_agent(launch: Launch) -> None:
    flying = launch(cascade_fleet())
    fleet, truth = flying.fleet, Truth(flying)
    fleet.take_off(height_m=0.9)
    truth.start_watch()
    missed = {name: fleet.state_of(name).agent.diagnostics.missed_ticks for name in ("h1", "h2")}
    for controller in ("lqr", "pid", "paper", "cascade"):
        assert fleet["h2"].tune(controller=controller).startswith(controller)
    for estimator in ("kalman", "finite_difference", "extended_kalman"):
        assert estimator in fleet["h2"].tune(estimator=estimator)
    for horizon in (60, 15, 30):
        assert f"horizon {horizon}" in fleet["h1"].tune(horizon=horizon)
    fleet["h2"].tune(horizon=24, input_weights=(15.0, 15.0, 15.0, 120.0))
    with pytest.raises(RefusedError, match=r"h2: .*> 0"):
        fleet["h2"].tune(input_weights=(-1.0, 1.0, 1.0, 1.0))
    with pytest.raises(RefusedError, match="allowed are cascade"):
        fleet["h2"].tune(controller="autopilot")
    truth.assert_nobody_touched_down()

    flying.wait_for_spare("agent-h2")
    flying.kill("agent-h2")

    def restored() -> bool:
        status = fleet.state_of("h2").agent
        return (
            flying.restarts("agent-h2") == 1
            and status is not None
            and status.phase == "flying"
            and status.diagnostics.horizon == 24
            and status.diagnostics.controller_settings.get("input_weights") == (15.0, 15.0, 15.0, 120.0)
        )

    fleet.wait_until(restored, 15, "h2 does not fly with what was tuned")
    truth.assert_nobody_touched_down()
    for name, before in missed.items():
        after = fleet.state_of(name).agent
        assert after is not None
        assert name == "h2" or after.diagnostics.missed_ticks == before, name
