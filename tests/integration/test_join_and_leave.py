"""Vehicles join and leave a fleet that flies; one that is absent keeps nobody on the floor."""

from collections.abc import Callable

import pytest
from integration_support import Flying, Truth

from ground_station.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]
CASCADE = 'controller = "cascade"\nhorizon = 30'


def test_a_vehicle_joins_a_flying_fleet_and_leaves_it_again(launch: Launch) -> None:
    flying = launch(control=CASCADE, without=("h3",))
    fleet = flying.fleet
    assert fleet.present() == ["h1", "h2"]
    truth = Truth(flying)
    assert fleet.take_off(height_m=0.8) == []
    pids = {name: flying.pid(f"agent-{name}") for name in ("h1", "h2")}
    assert fleet.join("h3", height_m=0.8) == "h3 follows h1"
    assert fleet.state_of("h3").leaders == ("h1",)
    assert truth.height_m("h3") > 0.5
    fleet["h2"].follow("h3", (0.0, 1.0, 0.0))
    with pytest.raises(RefusedError, match="h3 leads h2; let another vehicle lead them first"):
        fleet.leave("h3")
    fleet["h2"].follow("h1", (-0.4, 0.5, 0.0))
    fleet.wait_until(lambda: fleet.state_of("h2").leaders == ("h1",), 5, "h2 does not follow h1")
    with pytest.raises(RefusedError, match="h3 is in the air, its phase is flying; land it first"):
        fleet["h3"].stop()
    fleet.leave("h3")
    assert fleet.present() == ["h1", "h2"]
    fleet.wait_until(
        lambda: "agent-h3" not in flying.launcher_of("agent-h3").supervisor.running(), 10, "runs on"
    )
    assert min(truth.height_m(name) for name in ("h1", "h2")) > 0.5
    assert {name: flying.pid(f"agent-{name}") for name in ("h1", "h2")} == pids
    assert flying.restarts("agent-h3") == 0
    assert fleet.join("h3", height_m=0.8) == "h3 follows h1"
    fleet.land()


@pytest.mark.campaign
def test_a_fleet_flies_without_a_vehicle_whose_radio_is_missing(launch: Launch) -> None:
    flying = launch(control=CASCADE)
    truth = Truth(flying)
    (flying.launchers["main"].directory / "radio-h3").unlink()
    flying.kill("transmitters")
    flying.fleet.wait_until(
        lambda: any("h3: transmitter not ready" in line for line in flying.fleet.problems()),
        10,
        "h3 is ready",
    )
    behind = flying.fleet.take_off(height_m=0.8)
    assert len(behind) == 1
    assert behind[0].startswith("h3: transmitter not ready")
    assert min(truth.height_m(name) for name in ("h1", "h2")) > 0.5
    assert truth.height_m("h3") < 0.05
    flying.fleet.wait_for_formation(["h2"])
