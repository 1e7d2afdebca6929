"""A fleet of real processes takes off, flies in formation and lands; senseless requests are refused."""

import pytest
from integration_support import NAMES, Flying, Truth, fly_to, land_gently, not_killed, transmitter_state

from rcopterx.bus.messages import Plan
from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(180)]


TICKS = 5
"""Fewest that are recorded of a second's flight, of which a busy machine misses some."""


def leaders(plan: Plan | None) -> tuple[str, ...]:
    return () if plan is None else tuple(link.leader for link in plan.following)


def test_trio_takes_off_flies_in_formation_and_lands(flying: Flying, truth: Truth) -> None:
    recorder = FlightSampler(flying.fleet.session)
    recorder.start()
    fly_to(flying, truth, (0.3, 0.1, 0.9))
    truth.assert_none_touched_down()
    figures = FlightFigures(recorder.stop(), NAMES)
    for name in NAMES:
        table = figures.vehicle(name)
        assert table["ticks"] > TICKS
        assert table["tracking_error_mm"]["rms"] < 500
    assert len(figures.pose_to_command_ms()) > TICKS
    assert len(figures.frame_to_radio_ms()) > TICKS
    land_gently(flying, truth)
    flying.fleet.take_off(height_m=0.6, timeout_s=40)
    assert min(truth.height_m(name) for name in NAMES) > 0.3


def test_kill_latches_until_reset_and_vehicles_on_the_floor_are_not_followed(flying: Flying) -> None:
    fleet = flying.fleet
    fleet.kill(["h2"])
    fleet.wait_until(lambda: transmitter_state(flying, "h2") == "killed", 30, "not killed", ["h2"])
    with pytest.raises(RefusedError):
        fleet["h2"].arm()
    assert [transmitter_state(flying, name) for name in ("h1", "h3")] == ["armed", "armed"]
    fleet.wait_for_phase("ground", ["h2"])
    with pytest.raises(RefusedError, match="h2 does not fly, its phase is"):
        fleet.swap("h1", "h2")
    with pytest.raises(RefusedError, match="h2 is on the floor, its phase is"):
        fleet["h3"].follow("h2", (0.5, 0.0, 0.0))
    fleet.wait_until(lambda: not_killed(flying, "h2"), 30, "not reset", ["h2"])
    fleet.wait_until(lambda: transmitter_state(flying, "h2") == "disarmed", 30, "not reset", ["h2"])


def test_invalid_leaders_are_refused_with_the_reason_and_no_leader_changes(
    flying: Flying, truth: Truth
) -> None:
    fleet = flying.fleet
    with pytest.raises(RefusedError, match="itself"):
        fleet["h1"].follow("h1")
    with pytest.raises(RefusedError, match="known are"):
        fleet["h1"].follow("h9")
    with pytest.raises(RefusedError, match="h1 leads already"):
        fleet.promote("h1")
    with pytest.raises(
        RefusedError, match=r"h2 and h1 would be 0\.1 m apart, the minimum distance is 0\.3 m"
    ):
        fleet["h2"].follow("h1", (0.1, 0.0, 0.0))
    with pytest.raises(RefusedError, match=r"no place for h2: x: .* is outside the flight volume"):
        fleet["h2"].follow("h1", (5.0, 0.0, 0.0))
    with pytest.raises(RefusedError, match="a cycle: h1 follows h2 follows h1"):
        fleet["h1"].follow("h2", (0.5, 0.0, 0.0))
    assert [leaders(fleet[name].plan) for name in ("h1", "h2")] == [(), ("h1",)]
    assert truth.height_m("h1") > 0.5


def test_second_launch_is_refused_and_the_fleet_is_undisturbed(flying: Flying, truth: Truth) -> None:
    with pytest.raises(FleetError, match=r"^lab is already up on this computer; stop it first$"):
        Launcher(load_fleet(flying.path), "main")
    with Fleet(flying.fleet.file) as another:
        flying.fleet.wait_until(lambda: another.present() == list(NAMES), 30, "the fleet is disturbed", NAMES)
    truth.assert_none_touched_down()
