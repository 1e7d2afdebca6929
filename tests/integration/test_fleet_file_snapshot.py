"""What becomes of the fleet file while the fleet is up does not matter to what flies."""

from collections.abc import Callable

import pytest
from integration_support import Flying, Truth

from ground_station.fleet import Fleet

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]


def test_a_broken_save_of_the_fleet_file_changes_nothing_in_flight(launch: Launch) -> None:
    flying = launch()
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.8)
    flying.fleet.wait_for_formation()
    truth.start_watch()
    flying.path.write_text("half of a fi")
    for process in ("agent-h1", "router", "agent-h1"):
        restarts = flying.restarts(process)
        flying.wait_for_spare(process)
        flying.kill(process)
        flying.fleet.wait_until(
            lambda process=process, restarts=restarts: flying.restarts(process) > restarts,  # type: ignore[misc]
            10,
            f"{process} is not started again",
        )
    flying.fleet.wait_for_phase("flying")
    with Fleet.connect() as fleet:
        fleet["h1"].go_to((0.2, 0.0, 1.0))
        fleet.wait_for_arrival(["h1"])
        fleet.wait_for_formation()
    truth.assert_nobody_touched_down()
