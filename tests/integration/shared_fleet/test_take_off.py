"""A take-off that is interrupted ends at its height, and the command returns only then."""

import threading

import pytest
from integration_support import Flying, Truth, counter

from rcopterx.simulator.faults import Silence
from rcopterx_studies.faults.scenario import inject_faults

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]


def test_climb_without_frames_for_a_moment_ends_at_the_requested_height(flying: Flying, truth: Truth) -> None:
    fleet = flying.fleet
    fleet.land(["h1"])
    held = counter(flying, "h1", "entered HOLD")
    interrupted: list[float] = []

    def interrupt() -> None:
        fleet.wait_until(lambda: truth.height_m("h1") > 0.4, 30, "h1 does not climb")
        interrupted.append(truth.height_m("h1"))
        inject_faults(fleet.session, Silence(duration_s=0.2))

    thread = threading.Thread(target=interrupt)
    thread.start()
    fleet.take_off(["h1"], height_m=1.0, timeout_s=40)
    thread.join()
    assert len(interrupted) == 1
    assert interrupted[0] < 0.9
    assert counter(flying, "h1", "entered HOLD") > held
    assert truth.height_m("h1") > 0.9
