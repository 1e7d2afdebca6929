"""Batteries that are changed in turn for hours, all processes in one: pytest -m campaign -s, with this file.

The variable `RCOPTERX_ROTATION_HOURS` has the time of flight; a day in the laboratory has eight.
"""

import os
from pathlib import Path

import pytest
from support.bus import free_port
from support.example_programs import EXAMPLES, rotation
from support.places import PlaceWatch

from rcopterx.bus import channels
from rcopterx.bus.codec import decode
from rcopterx.bus.session import RawMessage
from rcopterx.fleet.reading import at_speed, load_fleet
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx_studies.search.one_process import in_one_process

pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(24 * 3600)]

HOURS = float(os.environ.get("RCOPTERX_ROTATION_HOURS", "0.1"))
GAP_S = 5.0
NEAREST_M = 0.4


@pytest.mark.parametrize(("name", "places", "period_s"), [("three", 3, 85.0), ("six", 6, 45.0)])
def test_for_hours_no_place_is_empty_for_long_and_no_battery_below_its_limit(
    name: str, places: int, period_s: float, tmp_path: Path
) -> None:
    path = tmp_path / f"{name}.toml"
    text = (
        (EXAMPLES / "rotation" / path.name).read_text().replace("127.0.0.1:18801", f"127.0.0.1:{free_port()}")
    )
    path.write_text(text)
    watch = PlaceWatch([rotation.Ring(places).place_m(place) for place in range(places)])
    changes = 0

    def store(message: RawMessage) -> None:
        if message.topic == channels.LABORATORY.topic:
            watch.take(decode(message.payload, channels.LABORATORY.message))
        elif message.topic == channels.TRANSMITTER_STATUS.topic and message.unit in file.vehicles:
            watch.take_status(message.unit, decode(message.payload, channels.TRANSMITTER_STATUS.message))

    def script(fleet: Fleet) -> None:
        nonlocal changes
        fleet.wait_ready(timeout_s=30.0)
        begun_s = fleet.session.clock()

        def say(line: str) -> None:
            print(f"{(fleet.session.clock() - begun_s) / 60.0:6.1f} min  {line}", flush=True)

        turning = rotation.Rotation(fleet, places, period_s, say)
        turning.begin()
        while fleet.session.clock() - begun_s < 3600.0 * HOURS:
            if turning.step():
                say(f"{turning.changes} changes in {watch}")
            else:
                fleet.wait(1.0)
        watch.end()
        changes = turning.changes
        fleet.home()

    file = at_speed(load_fleet(path), None, True)
    with in_one_process(file, store) as process:
        process.run(script)
    assert not process.turns.failures
    assert len(watch.gaps_s) <= changes
    assert max(watch.gaps_s, default=0.0) < GAP_S
    assert watch.nearest_m > NEAREST_M
    assert not watch.low
