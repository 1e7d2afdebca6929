"""Vehicles of a running fleet are identified; the models go into the fleet file, and fly at once."""

import json
import subprocess
import sys
from collections.abc import Callable

import pytest
from integration_support import Flying, Truth, fleet_text, free_port
from support.vehicle_types import COAXIAL

from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.vehicles.model import IDENTIFIED

pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]


def test_a_leader_is_identified_while_its_follower_flies_on(launch: Launch) -> None:
    hosts = {"main": ("127.0.0.1", free_port())}
    text = fleet_text(
        free_port(), hosts, simulator='conditions = "helicopter"', control='controller = "cascade"'
    )
    flying = launch(text)
    fleet, truth = flying.fleet, Truth(flying)
    fleet.take_off(height_m=1.0, timeout_s=40)
    truth.start_watch()
    command = (sys.executable, "-m", "rcopterx", "identify", "h1", "-f", str(flying.path))
    done = subprocess.run(
        [*command, "--seconds", "40", "--json"], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["problems"] == []
    frequency = next(row for row in document["parameters"] if row["name"] == "tilt frequency")
    assert frequency["value"] == pytest.approx(13.28, rel=0.1), "the middle of the family"
    written = model_of(load_fleet(flying.path), "h1")
    assert written.uncertainty == IDENTIFIED
    assert written.input_gain != COAXIAL.input_gain
    truth.assert_none_touched_down()
    fleet.land()


def test_a_formation_is_identified_at_the_same_time_and_returns(launch: Launch) -> None:
    hosts = {"main": ("127.0.0.1", free_port())}
    text = fleet_text(
        free_port(), hosts, simulator='conditions = "helicopters"', control='controller = "cascade"'
    )
    flying = launch(text)
    fleet, truth = flying.fleet, Truth(flying)
    fleet.take_off(height_m=1.0, timeout_s=40)
    truth.start_watch()
    command = (sys.executable, "-m", "rcopterx", "identify", "--all", "-f", str(flying.path))
    done = subprocess.run(
        [*command, "--seconds", "40", "--json"], capture_output=True, text=True, timeout=150, check=False
    )
    assert done.returncode == 0, done.stderr
    assert {one["vehicle"] for one in json.loads(done.stdout)["vehicles"]} == set(fleet.file.vehicles)
    changed = load_fleet(flying.path)
    assert all(model_of(changed, name).uncertainty == IDENTIFIED for name in changed.vehicles)
    fleet.wait_for_formation()
    truth.assert_none_touched_down()
    fleet.land()
