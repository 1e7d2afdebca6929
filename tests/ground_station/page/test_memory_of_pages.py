"""A page that is open for a day keeps nothing but its histories, which have an end."""

import time
from collections.abc import Iterator

import pytest
from support.bus import free_port
from support.garbage import PARTS, assert_flat
from support.scripted import ScriptedVehicle
from support.waiting import wait_for

from rcopterx.bus.messages import LeaderLink
from rcopterx.ground_station.page.history import KEPT_S
from rcopterx.ground_station.page.page import FleetPage, PageFrame
from rcopterx.ground_station.scripting.fleet import Fleet

PERIOD_S = 0.1


@pytest.fixture
def page(fleet: Fleet) -> Iterator[FleetPage]:
    frame = PageFrame(free_port(), fleet.file.name, "key-of-this-test")
    try:
        yield FleetPage(fleet, frame)
    finally:
        frame.server.stop()


def test_a_page_keeps_nothing_of_a_flight_but_its_newest_part(
    page: FleetPage, fleet: Fleet, vehicles: dict[str, ScriptedVehicle]
) -> None:
    vehicles["h2"].following = vehicles["h2"].assigned = (LeaderLink(leader="h1"),)
    for vehicle in vehicles.values():
        vehicle.phase, vehicle.state = "flying", "armed"
        vehicle.plan_at((0.0, 0.0, 1.0))
    wait_for(lambda: fleet["h2"].state.leaders and fleet["h1"].plan is not None, "no plan")
    begin_s = time.monotonic()

    def update(number: int) -> None:
        vehicles["h1"].phase = "flying" if number % 2 else "landing"
        vehicles["h1"].position_m = (0.001 * (number % 300), 0.2, 0.8)
        page.update(begin_s + PERIOD_S * number)

    assert_flat(update, round(PARTS * KEPT_S / PERIOD_S))
