"""Promises of the settings that the simulated laboratory gets from the fleet file."""

import math
from pathlib import Path

import pytest
from support.fleets import HARDWARE_PAIR, PAIR

from rcopterx.deploy.roles.simulator import conditions_of, simulator_settings
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError


@pytest.fixture(autouse=True)
def _own_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))


def test_vehicles_of_the_simulator_stand_in_formation_unless_placed_elsewhere(tmp_path: Path) -> None:
    start = "[simulator.start]\nh2 = [1.0, 0.5, 0.0, 1.5]"
    vehicles = simulator_settings(parse_fleet(PAIR), tmp_path).vehicles
    assert [(one.start.position_m, one.start.yaw_rad) for one in vehicles] == [
        ((0.0, 0.0, 0.0), 0.0),
        ((-0.4, 0.5, 0.0), 0.0),
    ]
    placed = simulator_settings(parse_fleet(PAIR.replace("[simulator]", start)), tmp_path).vehicles[1].start
    assert (placed.position_m, placed.yaw_rad) == ((1.0, 0.5, 0.0), 1.5)


def test_conditions_are_the_preset_with_single_changes_and_no_second_radio_delay() -> None:
    table = '[simulator]\nconditions = "ideal"\ncondition_overrides = { turbulence_rms = [1, 1, 1, 0] }'
    conditions = conditions_of(parse_fleet(PAIR.replace("[simulator]", table)))
    assert conditions.turbulence_rms == (1, 1, 1, 0)
    assert conditions.transport_delay_s == 0.0
    assert math.isclose(conditions.volume_max_m[2], 2.0)


def test_a_plant_without_its_library_is_refused_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    table = '[simulator]\ncondition_overrides = { attitude_plant = "drone_models:cf2x_L250" }'
    fleet = parse_fleet(PAIR.replace("[simulator]", table))
    assert conditions_of(fleet).attitude_plant == "drone_models:cf2x_L250"
    monkeypatch.setattr("rcopterx_studies.plants.identified_crazyflie.find_spec", lambda _: None)
    with pytest.raises(FleetError, match=r"simulator.conditions: .* 'rcopterx-studies\[physics\]'"):
        conditions_of(fleet)


def test_a_fleet_that_flies_hardware_has_nothing_to_simulate(tmp_path: Path) -> None:
    with pytest.raises(FleetError, match=r"simulator: this fleet flies hardware"):
        simulator_settings(parse_fleet(HARDWARE_PAIR), tmp_path)
