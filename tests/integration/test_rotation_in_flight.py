"""A formation whose vehicles change their batteries in turn: no place is empty for long."""

from collections.abc import Callable

import pytest
from integration_support import Flying
from support.bus import free_port
from support.example_programs import EXAMPLES, rotation
from support.places import PlaceWatch

from rcopterx.bus import channels

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(600)]

GAP_S = 5.0
NEAREST_M = 0.4
SHORT = "[defaults.battery]\nhover_s = 130.0\n"
"""Batteries that have to be changed from the beginning on."""


def short_flights() -> str:
    text = (EXAMPLES / "rotation" / "three.toml").read_text()
    text = text.replace("127.0.0.1:18801", f"127.0.0.1:{free_port()}")
    text = text.replace("battery_endurance_s = 400.0", "battery_endurance_s = 140.0")
    return f'{text}\n[bus]\nnamespace = "rotation"\n[hosts.main]\nrouter_port = {free_port()}\n{SHORT}'


def test_the_leader_and_a_follower_are_replaced_by_the_spare_and_leave_no_gap(
    fly: Callable[..., None],
) -> None:
    fly(replace_two, short_flights())


def replace_two(flying: Flying) -> None:
    fleet, said = flying.fleet, list[str]()
    truth = fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT, depth=20_000)
    turning = rotation.Rotation(fleet, 3, period_s=30.0, say=said.append)
    watch = PlaceWatch([turning.ring.place_m(place) for place in range(3)])
    turning.begin()
    fleet.wait_until(turning.step, 60.0, "no vehicle was replaced")
    fleet.wait_until(turning.step, 120.0, "the spare that came home was not charged")
    for received in truth.drain():
        watch.take(received.message)
    watch.end()
    fleet.home()
    assert turning.changes == 2, said
    assert said[0].endswith("leads"), "the first vehicle to be replaced leads"
    assert len(watch.gaps_s) == 2
    assert max(watch.gaps_s) < GAP_S
    assert watch.nearest_m > NEAREST_M
    assert set(turning.in_place) < set(fleet.file.vehicles)
    assert not any(vehicle.state.airborne for vehicle in fleet)
