"""Promises of the table of a fleet in a terminal."""

import io
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet, put, scripted
from support.waiting import wait_for

from rcopterx.bus.session import (
    BusAddress,
    Session,
)
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.terminal.live_table import COLUMNS, fleet_view
from rcopterx.ground_station.terminal.status import fleet_status

Vehicles = dict[str, ScriptedVehicle]


def rendered(fleet: Fleet) -> str:
    console = Console(width=350, record=True, file=io.StringIO())
    console.print(fleet_view(fleet, COLUMNS))
    return console.export_text()


def test_the_table_shows_every_vehicle_its_task_and_what_went_wrong(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h1"].counts = {"early_stop": 3, "[bold]odd": 1}
    put(vehicles, fleet, "flying", ["h1"])
    wait_for(lambda: "early stop 3" in rendered(fleet), "the fallback is not shown")
    text = rendered(fleet)
    assert all(words in text for column in COLUMNS for words in column.name.split())
    for part in ("flying", "armed", "0.10, 0.20, 0.30 m", "[bold]odd 1", "h2"):
        assert part in text
    assert "x:801" in text


def test_a_lowered_bandwidth_is_shown_and_noted(fleet: Fleet, vehicles: Vehicles) -> None:
    assert fleet.notes() == []
    vehicles["h2"].diagnostics = {"effort_factor": 27.0}
    wait_for(lambda: "effort ×" in rendered(fleet), "the factor is not shown")
    assert fleet.notes() == ["h2 oscillated: effort factor 27 until it is tuned"]
    assert fleet_status(fleet)["vehicles"]["h2"]["agent"]["effort_factor"] == 27.0


def test_the_table_shows_silent_vehicles_as_silent(fleet: Fleet, vehicles: Vehicles) -> None:
    vehicles["h2"].speaks = False
    wait_for(lambda: "(silent)" in rendered(fleet), "the silence is not shown")


def test_the_table_says_what_the_vicon_gateway_tries(
    bus_address: BusAddress, join: Callable[..., Session], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    with patient_fleet(parse_fleet(fleet_file_text(bus_address))) as fleet:
        assert "lab: Vicon gateway not responding yet" in rendered(fleet)
        assert "(silent)" in rendered(fleet)
        with scripted(join(), tracker="connecting"):
            wait_for(lambda: "Tracker is silent [/dev/null]" in rendered(fleet), "not shown")
