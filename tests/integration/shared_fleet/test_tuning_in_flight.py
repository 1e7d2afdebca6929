"""Controllers, estimators, weights and horizons change in flight, with real processes."""

import pytest
from integration_support import Flying, Truth, flown_by

from rcopterx.ground_station.scripting.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(180)]

WEIGHTS = (15.0, 15.0, 15.0, 120.0)


def test_everything_can_be_tuned_in_flight_and_survives_a_restart_of_the_agent(
    flying: Flying, truth: Truth
) -> None:
    fleet = flying.fleet
    for controller in ("lqr", "pid", "paper", "cascade"):
        assert fleet["h2"].tune(controller=controller).startswith(controller)
    for estimator in ("kalman", "finite_difference", "extended_kalman"):
        assert estimator in fleet["h2"].tune(estimator=estimator)
    for horizon in (15, 30):
        assert f"horizon {horizon}" in fleet["h1"].tune(horizon=horizon)
    fleet["h2"].tune(horizon=24, input_weights=WEIGHTS)
    with pytest.raises(RefusedError, match=r"h2: .*> 0"):
        fleet["h2"].tune(input_weights=(-1.0, 1.0, 1.0, 1.0))
    with pytest.raises(RefusedError, match="allowed are cascade"):
        fleet["h2"].tune(controller="autopilot")
    truth.assert_none_touched_down()

    flying.wait_for_spare("agent-h2")
    killed = flying.kill("agent-h2")

    def restored() -> bool:
        status = fleet.state_of("h2").agent
        return (
            flown_by(flying, "h2") not in (None, killed)
            and status is not None
            and status.diagnostics.horizon == 24
            and status.diagnostics.controller_settings.get("input_weights") == WEIGHTS
        )

    fleet.wait_until(restored, 30, "h2 does not fly with what was tuned", ["h2"])
    truth.assert_none_touched_down()
    # Another controller takes nothing but the horizon over: weights of the next tests are the usual ones.
    for controller in ("pid", "cascade"):
        fleet["h2"].tune(controller=controller, horizon=30)
