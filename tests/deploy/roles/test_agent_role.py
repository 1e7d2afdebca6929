"""Promises of the settings that agents get from the fleet file."""

from pathlib import Path

import pytest
from support.fleets import PAIR

from rcopterx.agents.flight.vehicle_watch import HoverThrustLimits
from rcopterx.agents.separation.avoidance import SeparationEllipsoid
from rcopterx.deploy.roles.agent import agent_settings
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError


@pytest.fixture(autouse=True)
def _own_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))


def test_agents_get_their_leaders_and_the_models_of_all_vehicles() -> None:
    fleet = parse_fleet(PAIR)
    leader, follower = agent_settings(fleet, "h1"), agent_settings(fleet, "h2")
    assert leader.following == ()
    assert [(link.leader, link.offset_m) for link in follower.following] == [("h1", (-0.4, 0.5, 0.0))]
    assert leader.vehicles == tuple(leader.models) == ("h1", "h2")
    assert leader.room.max_m == fleet.volume.max_m


def test_avoidance_is_on_unless_the_file_says_otherwise() -> None:
    assert agent_settings(parse_fleet(PAIR), "h1").separation == SeparationEllipsoid(0.35, 0.6)
    wider = PAIR + "[avoidance]\nhorizontal_m = 0.5\n"
    assert agent_settings(parse_fleet(wider), "h1").separation == SeparationEllipsoid(0.5, 0.6)
    off = PAIR + "[avoidance]\nenabled = false\n"
    assert agent_settings(parse_fleet(off), "h1").separation is None
    with pytest.raises(FleetError, match=r"^avoidance\.vertical_m: .*0\.0"):
        parse_fleet(PAIR + "[avoidance]\nvertical_m = -1.0\n")


def test_the_battery_has_limits_of_its_own() -> None:
    given = PAIR + "[vehicles.h2.battery]\nwarn_at_thrust = 0.7\nland_at_thrust = 0.75\n"
    assert agent_settings(parse_fleet(given), "h2").hover_thrust_limits == HoverThrustLimits(0.7, 0.75)
    assert agent_settings(parse_fleet(given), "h1").hover_thrust_limits == HoverThrustLimits()
    wrong = PAIR + "[vehicles.h2.battery]\nland_at_thrust = 0.5\n"
    with pytest.raises(FleetError, match=r"^vehicles\.h2\.battery\.land_at_thrust: 0\.5 must be at least"):
        agent_settings(parse_fleet(wrong), "h2")
