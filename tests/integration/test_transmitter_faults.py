"""Radios of every kind fly, and whatever happens to a transmitter leaves no vehicle uncontrolled."""

from collections.abc import Callable

import numpy as np
import pytest
from integration_support import NAMES, Flying, Truth, fleet_text, free_port, transmitter_state

from deploy.fleet import load_fleet

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]

RADIOS = {"h1": "dsm2_serial", "h2": "dsmp", "h3": "ppm"}


def trio_text(radios: dict[str, str] | None = None, **options: str) -> str:
    """Fleet of three vehicles that follow nobody, with the radio of each."""
    kinds = dict.fromkeys(NAMES, "multi") | (radios or {})
    vehicles = "\n".join(
        f"""
[vehicles.{name}]
subject = "{name}"
transmitter = {{ port = "radio-{name}", model_match = {number}, protocol = "{kinds[name]}" }}
"""
        for number, name in enumerate(NAMES, 1)
    )
    start = "[simulator.start]\nh1 = [0.6, 0, 0, 0]\nh2 = [-0.4, 0.6, 0, 0]\nh3 = [-0.4, -0.6, 0, 0]"
    port = free_port()
    return fleet_text(
        free_port(), {"main": ("127.0.0.1", port)}, vehicles=vehicles, simulator=start, **options
    )


def at(truth: Truth, name: str, position_m: tuple[float, float, float], tolerance_m: float = 0.12) -> bool:
    vehicle = truth(name)
    return vehicle is not None and np.linalg.norm(np.subtract(vehicle.position_m, position_m)) < tolerance_m


def test_vehicles_with_different_radios_fly_together(launch: Launch) -> None:
    flying = launch(trio_text(RADIOS))
    assert {v.transmitter.protocol for v in load_fleet(flying.path).vehicles.values()} == set(RADIOS.values())
    truth = Truth(flying)
    flying.fleet.take_off(height_m=0.7)
    truth.start_watch()
    places = {"h1": (0.5, 0.1, 0.9), "h2": (-0.5, 0.5, 0.9), "h3": (-0.3, -0.5, 0.9)}
    for name, place in places.items():
        flying.fleet[name].go_to(place)
    flying.fleet.wait_until(
        lambda: all(at(truth, name, place) for name, place in places.items()), 15, "not all have arrived"
    )
    truth.assert_nobody_touched_down()
    flying.fleet.land()
    for name in NAMES:
        vehicle = truth(name)
        assert vehicle is not None
        assert vehicle.on_floor
        assert vehicle.touchdown_speed_m_s < 1.0
        assert transmitter_state(flying, name) in ("disarmed", "armed")
