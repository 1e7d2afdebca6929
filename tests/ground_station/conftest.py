"""A fleet without helicopters for the scripting interface."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet, scripted
from support.waiting import DEADLINE_S, wait_for

from rcopterx.bus.session import BusAddress, Session
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.scripting.fleet import Fleet


@pytest.fixture(autouse=True)
def _patience_with_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers may be late: the processor is shared with other tests."""
    monkeypatch.setattr("rcopterx.ground_station.scripting.vehicle.ANSWER_S", DEADLINE_S)


@pytest.fixture
def vehicles(join: Callable[..., Session]) -> Iterator[dict[str, ScriptedVehicle]]:
    """The vehicles behind the fleet; change what they say and do."""
    with scripted(join(), "h1", "h2") as running:
        yield running


@pytest.fixture
def fleet(
    bus_address: BusAddress,
    vehicles: dict[str, ScriptedVehicle],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[Fleet]:
    """The scripting interface of the scripted fleet, once every vehicle has reported."""
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    running = patient_fleet(parse_fleet(fleet_file_text(bus_address)))
    wait_for(lambda: not running.problems(), "no status arrives")
    yield running
    running.close()
