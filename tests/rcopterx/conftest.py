"""Fixtures for tests of commands: a run directory of their own, and scripted vehicles on a bus."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet, scripted
from support.waiting import DEADLINE_S, wait_for

from rcopterx.bus import channels
from rcopterx.bus.session import BusAddress, Session


@pytest.fixture(autouse=True)
def _own_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path / "run"))


@pytest.fixture
def names() -> tuple[str, ...]:
    """Vehicles of the fleet."""
    return ("h1", "h2")


@pytest.fixture
def vehicles(join: Callable[..., Session], names: tuple[str, ...]) -> Iterator[dict[str, ScriptedVehicle]]:
    with scripted(join(), *names) as running:
        yield running


@pytest.fixture
def up(
    bus_address: BusAddress,
    vehicles: dict[str, ScriptedVehicle],
    tmp_path: Path,
    join: Callable[..., Session],
    monkeypatch: pytest.MonkeyPatch,
) -> str:
    """Fleet file of a fleet whose vehicles speak and can be asked."""
    monkeypatch.setattr("rcopterx.ground_station.scripting.fleet.Fleet", patient_fleet)
    monkeypatch.setattr("rcopterx.ground_station.scripting.vehicle.ANSWER_S", DEADLINE_S)
    path = tmp_path / "up.toml"
    path.write_text(fleet_file_text(bus_address, tuple(vehicles)))
    statuses = join().subscribe_all(channels.AGENT_STATUS)
    wait_for(lambda: set(vehicles) <= set(statuses.inboxes), "the scripted vehicles do not speak")
    return str(path)
