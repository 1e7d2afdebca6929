"""Promises of the live table: it fits into the terminal, and no cell is cut."""

import io

import pytest
from rich.console import Console
from support.scripted import ScriptedVehicle
from support.waiting import wait_for

from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.ground_station.terminal.live_table import COLUMNS, FULL_WIDTH, fitting, fleet_view

Vehicles = dict[str, ScriptedVehicle]


UNHEARD = VehicleState("h4")


@pytest.mark.parametrize("width", [3, 10, 40, 80, 100, 150, 200, FULL_WIDTH, 400])
def test_the_first_columns_that_fit_are_shown_and_always_the_vehicle(width: int) -> None:
    shown = fitting(width)
    assert tuple(shown) == COLUMNS[: len(shown)]
    assert shown[0].name == "vehicle"
    assert (len(shown) == len(COLUMNS)) == (width >= FULL_WIDTH)


def test_a_terminal_of_80_columns_shows_how_and_how_well_vehicles_fly() -> None:
    names = {column.name for column in fitting(80)}
    assert {"phase", "arbiter", "flown by", "follows", "error", "seen ago", "missed periods"} <= names


@pytest.mark.parametrize("width", [80, 120, FULL_WIDTH])
def test_no_cell_is_cut_and_no_line_is_wider_than_the_terminal(
    fleet: Fleet, vehicles: Vehicles, width: int
) -> None:
    vehicles["h1"].phase, vehicles["h1"].state = "emergency", "descend"
    vehicles["h2"].counts = {"early_stop": 3, "leader_plan_late": 12}
    vehicles["h2"].diagnostics = {"client": "octave"}
    wait_for(lambda: "octave" in shown(fleet, width), "the client is not shown")
    wait_for(lambda: "descend" in shown(fleet, width), "the phase is not shown")
    text = shown(fleet, width)
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    for words in ("emergency", "descend", "paper", "external"):
        assert words in text
    if width == FULL_WIDTH:
        for words in ("0.10, 0.20, 0.30 m", "early stop 3", "leader plan late"):
            assert words in text


def shown(fleet: Fleet, width: int) -> str:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(fleet_view(fleet, fitting(width)))
    return console.export_text()


def test_a_fleet_and_a_state_print_short_and_readable(fleet: Fleet, vehicles: Vehicles) -> None:
    assert repr(fleet) == "<Fleet lab: h1, h2>"
    assert repr(fleet["h1"]) == "<Vehicle h1>"
    assert str(UNHEARD) == "h4: unknown, transmitter unknown"
    assert repr(UNHEARD) == f"<VehicleState {UNHEARD}>"
    line = "ground, transmitter disarmed, flown by paper, leads, at 0.10 0.20 0.30 m, heading 0 deg"
    assert str(fleet) == f"fleet lab\n  h1: {line}\n  h2: {line}"
    vehicles["h2"].diagnostics = {"client": "octave"}
    wait_for(lambda: "flown by octave (external)" in str(fleet["h2"]), "the client is not told")
