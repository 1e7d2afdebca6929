"""Vehicles join and leave a fleet that flies; an absent one does not block take-off."""

import pytest
from integration_support import Flying, Truth

from rcopterx.ground_station.scripting.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(180)]


def test_a_vehicle_leaves_a_flying_fleet_and_joins_it_again(flying: Flying, truth: Truth) -> None:
    fleet = flying.fleet
    supervisor = flying.launcher_of("agent-h3").supervisor
    pids = {name: flying.pid(f"agent-{name}") for name in ("h1", "h2")}
    restarts = flying.restarts("agent-h3")
    fleet["h2"].follow("h3", (0.0, 1.0, 0.0))
    fleet.wait_until(lambda: fleet.state_of("h2").leaders == ("h3",), 30, "h2 does not follow h3")
    with pytest.raises(RefusedError, match="h3 leads h2; let another vehicle lead them first"):
        fleet.leave("h3")
    fleet["h2"].follow("h1", (-0.4, 0.5, 0.0))
    fleet.wait_until(lambda: fleet.state_of("h2").leaders == ("h1",), 30, "h2 does not follow h1")
    with pytest.raises(RefusedError, match="h3 is in the air, its phase is flying; land it first"):
        fleet["h3"].stop()
    fleet.leave("h3")
    assert fleet.present() == ["h1", "h2"]
    fleet.wait_until(lambda: "agent-h3" not in supervisor.running(), 30, "runs on")
    assert min(truth.height_m(name) for name in ("h1", "h2")) > 0.5
    assert fleet.join("h3", height_m=0.8) == "h3 follows h1"
    assert fleet.state_of("h3").leaders == ("h1",)
    fleet.wait_until(lambda: truth.height_m("h3") > 0.5, 30, "h3 does not fly")
    assert {name: flying.pid(f"agent-{name}") for name in ("h1", "h2")} == pids
    assert flying.restarts("agent-h3") == restarts
