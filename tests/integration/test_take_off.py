"""A take-off that is interrupted ends at its height, and the command returns only then."""

import threading
from collections.abc import Callable

import pytest
from integration_support import Flying, Truth

from ground_station.scenario import inject_faults
from simulator.faults import Silence

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]


def test_a_climb_without_frames_for_a_moment_ends_at_the_height_that_was_asked_for(launch: Launch) -> None:
    flying = launch()
    truth = Truth(flying)
    interrupted: list[str] = []

    def interrupt() -> None:
        flying.fleet.wait_until(lambda: truth.height_m("h1") > 0.4, 15.0, "h1 does not climb")
        inject_faults(flying.fleet.session, Silence(duration_s=0.15))
        flying.fleet.wait_for_phase("emergency", ["h1"], 2.0)
        interrupted.append("h1")

    thread = threading.Thread(target=interrupt)
    thread.start()
    flying.fleet.take_off(["h1"], height_m=1.0)
    thread.join()
    assert interrupted == ["h1"]
    assert truth.height_m("h1") > 0.9
