"""Vehicles whose poses are of others, or stand still, come down where they were, but for the draught."""

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest
from integration_support import NAMES, Flying, Truth, landed_gently, transmitter_state

from rcopterx.simulator import faults
from rcopterx.simulator.faults import Fault
from rcopterx_studies.faults.scenario import inject_faults

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(240)]

FOR_GOOD_S = 60.0
SWAPPED = faults.SwapSubjects("heli2", "heli3", duration_s=FOR_GOOD_S)
FROZEN = faults.FreezePose("heli2", duration_s=FOR_GOOD_S)
HELICOPTERS = 'conditions = "helicopters"\nseed = {seed}'
STILL_AIR = "condition_overrides = {{ turbulence_rms = [0.0, 0.0, 0.0, 0.0] }}"


@pytest.mark.parametrize(("fault", "landing", "seed"), [(SWAPPED, ("h2", "h3"), 1), (FROZEN, ("h2",), 2)])
def test_in_still_air_vehicles_that_are_confused_come_down_where_they_were(
    fly: Callable[..., None], fault: Fault, landing: tuple[str, ...], seed: int
) -> None:
    carried_m = carried_by(fly, fault, landing, f"{HELICOPTERS}\n{STILL_AIR}".format(seed=seed))
    assert max(carried_m.values()) < 0.2


@pytest.mark.campaign
@pytest.mark.parametrize(("fault", "landing"), [(SWAPPED, ("h2", "h3")), (FROZEN, ("h2",))])
def test_the_draught_of_a_laboratory_carries_vehicles_that_are_confused_0_35_m_rms(
    fly: Callable[..., None], fault: Fault, landing: tuple[str, ...]
) -> None:
    carried_m: list[float] = []
    for seed in range(1, 25):
        carried_m += carried_by(fly, fault, landing, HELICOPTERS.format(seed=seed)).values()
    rms_m = math.sqrt(np.mean(np.square(carried_m)))
    print(f"\n{len(carried_m)} vehicles, {rms_m:.2f} m rms, at most {max(carried_m):.2f} m")
    assert rms_m < 0.35
    assert max(carried_m) < 1.0


def carried_by(
    fly: Callable[..., None], fault: Fault, landing: tuple[str, ...], simulator: str
) -> Mapping[str, float]:
    """Distances over ground from where vehicles hovered to where they came down because of a fault [m]."""
    carried_m: dict[str, float] = {}

    def flight(flying: Flying) -> None:
        truth, fleet = Truth(flying), flying.fleet

        def place(name: str) -> tuple[float, ...]:
            vehicle = truth(name)
            assert vehicle is not None
            return vehicle.position_m[:2]

        def landed(name: str) -> bool:
            return landed_gently(truth, name) and transmitter_state(flying, name) in ("cut", "disarmed")

        fleet.take_off(height_m=0.8, timeout_s=30)
        fleet.wait_for_formation()
        truth.start_watch()
        fleet.wait_until(truth.rested, 30, "no rest", NAMES)
        places = {name: place(name) for name in landing}
        inject_faults(fleet.session, fault)
        fleet.wait_until(lambda: all(map(landed, landing)), 30, "not landed", landing)
        carried_m.update({name: math.dist(place(name), places[name]) for name in landing})

    fly(flight, simulator=simulator)
    return carried_m
