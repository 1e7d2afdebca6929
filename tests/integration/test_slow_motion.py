"""A fleet flies in slow motion as in real time: only its clock differs."""

import time
from collections.abc import Callable

import pytest
from integration_support import Flying, Truth

from rcopterx.bus import channels
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.fleet import Fleet

pytestmark = [pytest.mark.integration, pytest.mark.timeout(240)]

SPEED = 0.5
RATE_HZ = 50
"""Of the simulated Tracker."""


def test_a_fleet_flies_in_its_own_time(launch: Callable[..., Flying]) -> None:
    flying = launch(simulator=f"speed = {SPEED}")
    fleet, clock = flying.fleet, flying.fleet.session.clock
    with Fleet.connect() as other:
        assert other.file.clock == fleet.file.clock
        assert other.file.clock.speed == SPEED
    fleet.take_off(timeout_s=40)
    truth, recorder = Truth(flying), FlightSampler(fleet.session, only=(channels.POSE,))
    fleet.wait_until(lambda: truth("h1") is not None, 10, "no laboratory")
    truth.start_watch()
    recorder.start()
    began_s, began_real_s = clock(), time.monotonic()
    fleet["h1"].go_to((0.3, 0.2, 1.2))
    fleet.wait_for_arrival(["h1"])
    fleet.wait_for_formation()
    flying.wait_for_spare("agent-h2")
    flying.kill("agent-h2")
    fleet.wait(2.0)
    fleet.wait_until(lambda: flying.restarts("agent-h2") == 1, 30, "h2 has no successor")
    fleet.wait_for_formation()
    passed_s = clock() - began_s
    assert passed_s == pytest.approx(SPEED * (time.monotonic() - began_real_s), rel=0.01)
    frames = [pose.frame for pose, _ in recorder.stop().messages(channels.POSE, "h1")]
    assert frames[-1] - frames[0] == pytest.approx(RATE_HZ * passed_s, abs=RATE_HZ)
    truth.assert_none_touched_down()
    assert all(vehicle.state.phase == "flying" for vehicle in fleet)
    fleet.land()
