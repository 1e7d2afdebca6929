"""Vehicles of a running fleet are identified; the models go into the fleet file, and fly at once."""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from integration_support import Flying, Truth, fleet_text
from support.vehicle_types import COAXIAL

from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.vehicles.model import IDENTIFIED

pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(180)]

Launch = Callable[..., Flying]
CASCADE = 'controller = "cascade"'


def formation(
    launch: Launch, conditions: str, control: str = CASCADE, vehicles: str | None = None
) -> tuple[Flying, Truth]:
    """A formation that hovers in the simulated laboratory, watched from then on."""
    text = fleet_text(
        simulator=f'conditions = "{conditions}"',
        control=control,
        vehicles=vehicles,
    )
    flying = launch(text)
    truth = Truth(flying)
    flying.fleet.take_off(height_m=1.0, timeout_s=40)
    truth.start_watch()
    return flying, truth


def identified(flying: Flying, vehicles: str, limit_s: float) -> Any:
    """Document of `rcopterx identify`."""
    command = (sys.executable, "-m", "rcopterx", "identify", vehicles, "-f", str(flying.path))
    done = subprocess.run(
        [*command, "--seconds", "40", "--json"], capture_output=True, text=True, timeout=limit_s, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_leader_is_identified_while_its_follower_flies_on(launch: Launch) -> None:
    flying, truth = formation(launch, "helicopter")
    document = identified(flying, "h1", 120)
    assert document["problems"] == []
    frequency = next(row for row in document["parameters"] if row["name"] == "tilt frequency")
    assert frequency["value"] == pytest.approx(13.28, rel=0.1), "the middle of the family"
    written = model_of(load_fleet(flying.path), "h1")
    assert replace(written.uncertainty, tilt_damping=None) == IDENTIFIED
    assert written.input_gain != COAXIAL.input_gain
    status = flying.fleet["h1"].state.agent
    assert status is not None
    flown = Configuration.reported(status.diagnostics).flown_model(COAXIAL)
    assert flown.input_gain == written.input_gain, "in flight already"
    truth.assert_none_touched_down()
    flying.fleet.land()


def test_a_formation_is_identified_at_the_same_time_and_returns(launch: Launch) -> None:
    flying, truth = formation(launch, "helicopters")
    document = identified(flying, "--all", 150)
    assert {one["vehicle"] for one in document["vehicles"]} == set(flying.fleet.file.vehicles)
    changed = load_fleet(flying.path)
    found = [model_of(changed, name).uncertainty for name in changed.vehicles]
    assert all(replace(uncertainty, tilt_damping=None) == IDENTIFIED for uncertainty in found)
    flying.fleet.wait_for_formation()
    truth.assert_none_touched_down()
    flying.fleet.land()


@pytest.mark.timeout(300)
def test_five_vehicles_find_room_in_a_volume_that_their_enlarged_formation_would_leave(
    launch: Launch,
) -> None:
    shipped = fleet_path("quintet").read_text()
    volume = shipped[shipped.index("[volume]") : shipped.index("[tracker]")]
    chain = shipped[shipped.index("[vehicles.h1]") : shipped.index("[avoidance]")]
    flying, truth = formation(launch, "helicopter", f"{CASCADE}\nhorizon = 30", volume + chain)
    document = identified(flying, "--all", 200)
    assert document["failed"] == {}
    assert len(document["vehicles"]) == 5
    flying.fleet.wait_for_formation()
    truth.assert_none_touched_down()
    flying.fleet.land()
