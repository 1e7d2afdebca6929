"""Serial adapters with equal serial numbers."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from support.fleets import HARDWARE_PAIR

from rcopterx.deploy.hosts.resources import check_resources
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.transmitter_gateway import adapters
from rcopterx.transmitter_gateway.adapters import plugged_in, with_same_serial_number


def entry(device: Path, number: str | None, location: str) -> SimpleNamespace:
    return SimpleNamespace(
        device=str(device), vid=1, description="CP2102", serial_number=number, location=location
    )


@pytest.fixture
def names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory of names by serial number; two of four adapters have the same one."""
    devices = [tmp_path / f"ttyUSB{number}" for number in range(5)]
    for device in devices:
        device.touch()
    directory = tmp_path / "names"
    directory.mkdir()
    (directory / "0001").symlink_to(devices[1])
    (directory / "A1").symlink_to(devices[2])
    found = [
        entry(devices[0], "0001", "1-1"), entry(devices[1], "0001", "1-2"),
        entry(devices[2], "A1", "1-3:1.0"), entry(devices[3], "A1", "1-3:1.1"),
        entry(devices[4], None, "1-4"),
    ]  # fmt: skip
    monkeypatch.setattr(adapters.list_ports, "comports", lambda: found)
    monkeypatch.setattr(adapters, "STABLE_NAMES", (directory,))
    return directory


def test_a_serial_number_of_two_adapters_leads_to_both(names: Path) -> None:
    both = tuple(str(names.parent / f"ttyUSB{number}") for number in (0, 1))
    assert with_same_serial_number(str(names / "0001")) == both
    assert with_same_serial_number(str(names / "A1")) == (), "two ports of one adapter"
    assert with_same_serial_number(both[0]) == ()


def test_an_adapter_without_a_number_of_its_own_is_not_offered_by_it(names: Path) -> None:
    offered = [adapter.port for adapter in plugged_in((names,))]
    assert str(names / "0001") not in offered
    assert offered[0] == str(names.parent / "ttyUSB0")
    assert offered[2] == str(names / "A1")


def test_a_fleet_whose_port_leads_to_either_of_two_adapters_is_refused_with_both(names: Path) -> None:
    fleet = parse_fleet(HARDWARE_PAIR.replace("radio-h1", str(names / "0001"), 1))
    with pytest.raises(
        FleetError, match=r"0001 may lead to any of .*ttyUSB0, .*ttyUSB1.* same serial number"
    ):
        check_resources(fleet, "main", names.parent)
