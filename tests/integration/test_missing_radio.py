"""A fleet flies without a vehicle whose radio is missing."""

from collections.abc import Callable

import pytest
from integration_support import Flying, Truth

pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(180)]


def test_a_fleet_flies_without_a_vehicle_whose_radio_is_missing(launch: Callable[..., Flying]) -> None:
    flying = launch()
    truth = Truth(flying)
    (flying.launchers["main"].directory / "radio-h3").unlink()
    flying.kill("transmitters")
    flying.fleet.wait_until(
        lambda: any("h3: transmitter not ready" in line for line in flying.fleet.problems()),
        30,
        "h3 is ready",
    )
    behind = flying.fleet.take_off(height_m=0.8, timeout_s=40)
    assert len(behind) == 1
    assert behind[0].startswith("h3: transmitter not ready")
    assert min(truth.height_m(name) for name in ("h1", "h2")) > 0.5
    assert truth.height_m("h3") < 0.05
    flying.fleet.wait_for_formation(["h2"])
