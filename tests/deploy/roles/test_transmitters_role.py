"""Promises of the settings that transmitter gateways get from the fleet file."""

from dataclasses import replace
from pathlib import Path

import pytest
from support.fleets import HARDWARE_PAIR, PAIR
from support.vehicle_types import COAXIAL

from rcopterx.deploy.processes.table import processes_of
from rcopterx.deploy.roles.transmitters import gateway_settings
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.fleet.vehicle_models import landing_of, limits_of, longest_shutdown_s
from rcopterx.radios.registry import PROTOCOL_NAMES, default_line


@pytest.fixture(autouse=True)
def _own_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))


def test_a_gateway_gets_its_own_transmitters_and_hears_all_vehicles(tmp_path: Path) -> None:
    fleet = parse_fleet(
        HARDWARE_PAIR.replace('"radio-h1"', '"/dev/ttyUSB0", gateway = "roof"')
        + "[gateways.roof]\n[gateways.transmitters]"
    )
    settings = {name: gateway_settings(fleet, name, tmp_path) for name in fleet.gateways}
    ports = {
        name: [(radio.vehicle, radio.port) for radio in one.transmitters] for name, one in settings.items()
    }
    assert ports == {
        "roof": [("h1", "/dev/ttyUSB0")],
        "transmitters": [("h2", str(tmp_path / "radio-h2"))],
    }
    assert settings["roof"].vehicles == ("h1", "h2")


@pytest.mark.parametrize("name", PROTOCOL_NAMES)
def test_hardware_speaks_the_protocol_the_file_names(name: str) -> None:
    protocol = protocol_of(parse_fleet(HARDWARE_PAIR + f'[defaults.transmitter]\nprotocol = "{name}"'), "h2")
    assert protocol.name == name
    assert protocol.line == default_line(name)


def test_simulated_lines_have_no_parity_and_carry_the_model_match() -> None:
    protocol = protocol_of(parse_fleet(PAIR), "h2")
    assert protocol.line.parity == "N"
    assert protocol.encode([1100.0])[2] & 0x0F == 2


def test_the_fence_is_the_volume_unless_it_is_switched_off() -> None:
    fence = limits_of(parse_fleet(PAIR), "h1").surveillance.fence
    assert fence is not None
    assert (fence.lower_m, fence.upper_m) == ((-1.2, -1.2, 0.0), (1.2, 1.2, 2.0))
    assert limits_of(parse_fleet(PAIR + "[safety]\ngeofence = false"), "h1").surveillance.fence is None


def test_the_arbiter_limits_are_those_of_the_model_and_of_the_file() -> None:
    limits = limits_of(
        parse_fleet(
            PAIR
            + "model = { input_max = [0.5, 0.5, 0.9, 0.3] }\n[safety.settings]\nhold_after_s = 0.08\n"
            + "[safety.settings.surveillance]\nminimum_distance_m = 0.2"
        ),
        "h2",
    )
    assert limits.upper == (0.5, 0.5, 0.9, 0.3)
    assert limits.hold_after_s == 0.08
    assert limits.surveillance.minimum_distance_m == 0.2
    assert limits.surveillance.fence is not None


@pytest.mark.parametrize(("lowest_m", "floor_m"), [(0.3, 0.0), (0.0, 0.0), (-0.7, -0.7)])
def test_volume_that_begins_above_the_floor_forbids_neither_arming_nor_landing(
    lowest_m: float, floor_m: float
) -> None:
    volume = f"[volume]\nmin_m = [-1, -1, {lowest_m}]\nmax_m = [1, 1, 2]\n"
    limits = limits_of(parse_fleet(PAIR + volume), "h1")
    assert limits.floor_m == floor_m
    assert limits.surveillance.fence is not None
    assert limits.surveillance.fence.lower_m == (-1.0, -1.0, floor_m)


@pytest.mark.parametrize(
    ("height_m", "descent_m_s", "longest_s"), [(2, 0.4, 20.0), (8, 0.4, 41.5), (8, 0.2, 81.5)]
)
def test_a_landing_may_last_as_long_as_the_height_of_the_volume_needs(
    height_m: float, descent_m_s: float, longest_s: float
) -> None:
    text = f"[volume]\nmin_m = [-1, -1, 0]\nmax_m = [1, 1, {height_m}]\n"
    text += f"[safety.settings.landing]\ndescent_m_s = {descent_m_s}\n"
    fleet = parse_fleet(PAIR + text)
    limits = limits_of(fleet, "h1")
    assert limits.landing.longest_s == pytest.approx(longest_s)
    assert limits.longest_shutdown_s > longest_s + limits.cut_after_s - limits.descend_after_s
    assert longest_shutdown_s(fleet, "main") == limits.longest_shutdown_s
    gateway = next(spec for spec in processes_of(fleet, "main") if spec.role == "transmitters")
    assert gateway.landing_s == limits.longest_shutdown_s


def test_law_that_lands_a_vehicle_knows_the_gains_of_its_model_and_the_limits_of_the_file() -> None:
    fleet = parse_fleet(PAIR + "[safety.settings.landing]\ndescent_m_s = 0.3\n")
    landing = limits_of(fleet, "h1").landing
    assert landing.input_gain == COAXIAL.input_gain[:3]
    assert landing.yaw_rate_gain_rad_s == pytest.approx(111 / 5)
    assert landing.descent_m_s == 0.3
    assert landing_of(replace(COAXIAL, damping=(0.0, 0.0, 0.0, 0.0))).yaw_rate_gain_rad_s == 111


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ("landing = 3", "safety.settings.landing: expected `object`, got `int`"),
        ("[safety.settings.landing]\ndescent_m_s = 0", "landing.descent_m_s: 0.0 must be a positive number"),
        ('[safety.settings.landing]\ndescent_m_s = "slow"', "safety.settings.landing.descent_m_s: expected"),
        ("[safety.settings.landing]\nspeed = 1", "safety.settings.landing"),
        ("[safety.settings.landing]\ncyclic = -1", "landing.cyclic"),
    ],
)
def test_wrong_landing_settings_are_refused_with_their_place(settings: str, problem: str) -> None:
    text = f"{PAIR}[safety.settings]\n{settings}\n" if "[" not in settings else f"{PAIR}{settings}\n"
    with pytest.raises(FleetError, match=problem):
        limits_of(parse_fleet(text), "h1")
