"""Five vehicles in a chain, with real processes: all keep their places along the line."""

from collections.abc import Callable

import numpy as np
import pytest
from integration_support import Flying, fleet_text

from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import FlightSampler

pytestmark = [pytest.mark.integration, pytest.mark.timeout(240)]

Launch = Callable[..., Flying]
CHAIN = ("h1", "h2", "h3", "h4", "h5")
ERROR_MM = 120.0
"""Of any link, in laboratory conditions, at a horizon of 20."""


def chain() -> str:
    tables = []
    for number, name in enumerate(CHAIN, 1):
        follow = f'follow = [{{ leader = "h{number - 1}", offset_m = [-0.4, 0.0, 0.0] }}]'
        tables.append(
            f"""
[vehicles.{name}]
subject = "heli{number}"
transmitter = {{ port = "radio-{name}", model_match = {number} }}
{follow if number > 1 else ""}
"""
        )
    return "\n".join(tables)


@pytest.mark.campaign
def test_chain_of_five_follows_its_head_and_publishes_the_whole_line(launch: Launch) -> None:
    starts = ", ".join(f"{name} = [{0.8 - 0.4 * number}, 0, 0, 0]" for number, name in enumerate(CHAIN))
    text = fleet_text(
        vehicles=chain(),
        control='controller = "cascade"\nhorizon = 20',
        simulator=f"start = {{ {starts} }}",
    )
    flying = launch(text)
    fleet = flying.fleet
    fleet.take_off(height_m=0.8, timeout_s=40)
    fleet.wait_for_formation()
    plan = fleet["h5"].plan
    assert plan is not None
    assert plan.ancestors == ("h4", "h3", "h2", "h1")
    recorder = FlightSampler(fleet.session)
    recorder.start()
    fleet["h1"].go_to((0.8, 0.3, 1.0))
    fleet.wait_for_arrival(["h1"])
    fleet["h1"].go_to((0.8, 0.0, 0.8))
    fleet.wait_for_arrival(["h1"])
    fleet.wait_for_formation()
    figures = FlightFigures(recorder.stop(), CHAIN)
    for name in CHAIN[1:]:
        errors_m = figures.formation_error_m(name)
        assert len(errors_m) > 50
        assert 1000 * np.max(errors_m) < ERROR_MM, name
    answer = fleet["h5"].follow("h2", (-1.2, 0.0, 0.0))
    assert answer == "h5 follows h2 follows h1"
    fleet.wait_for_formation(["h5"])
    assert sorted(fleet.promote("h3")) == [
        "h1 follows h2 (before: leads)",
        "h2 follows h3 (before: follows h1)",
        "h3 leads (before: follows h2)",
        "h4 follows h1 (before: follows h3)",
    ]
    fleet.wait_for_formation()
    fleet.land()
