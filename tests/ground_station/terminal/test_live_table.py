"""Promises of the live table: it fits into the terminal, and what does not fit is on a further page."""

import io

import pytest
from rich.console import Console
from support.scripted import ScriptedVehicle
from support.statuses import flying_status
from support.waiting import wait_for

from rcopterx.bus.messages import LeaderLink, TransmitterStatus
from rcopterx.commands.watch import COLUMN_NAMES
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.ground_station.terminal.live_table import (
    COLUMNS,
    LATENCY,
    columns_named,
    fleet_view,
    pages,
    table_width,
)

Vehicles = dict[str, ScriptedVehicle]


def flying(name: str, *leaders: str, **changes: object) -> VehicleState:
    links = tuple(LeaderLink(leader=leader, offset_m=(0.0, 0.0, 0.0)) for leader in leaders)
    agent = flying_status(position_m=(-0.5, 0.2, 1.04), controller="cascade", following=links, **changes)
    transmitter = TransmitterStatus(
        state="disarmed", reason="", link="open", module="", ready=True, command_age_s=0.003
    )
    return VehicleState(name, agent, transmitter, 0.1, 0.1, 0.01, 0.012)


STATES = [flying("h1"), flying("h2", "h1", phase="emergency"), flying("h3", "h1", "h2")]
UNHEARD = VehicleState("h4", None, None, None, None, None)


@pytest.mark.parametrize("width", [10, 40, 80, 100, 150, 200, 300])
def test_every_column_is_on_one_page_and_every_page_begins_with_the_vehicle(width: int) -> None:
    found = pages([*STATES, UNHEARD], width)
    assert all(page[0].name == "vehicle" for page in found)
    shown = [column.name for page in found for column in page[1:]]
    assert sorted(shown) == sorted(name for name in COLUMN_NAMES[1:] if name != LATENCY)


def test_a_terminal_of_80_columns_shows_who_flies_how_and_how_well() -> None:
    first, *others = pages(STATES, 80)
    assert {"phase", "arbiter", "flown-by", "follows", "error", "pose", "missed"} < {
        column.name for column in first
    }
    assert [column.name for page in others for column in page if column.name.endswith("-ms")]
    assert len(others) == 3


def test_a_wide_terminal_shows_everything_on_one_page() -> None:
    assert pages(STATES, 320) == [COLUMNS]


@pytest.mark.parametrize("width", [80, 120, 160])
def test_no_cell_is_cut_and_no_line_is_wider_than_the_terminal(
    fleet: Fleet, vehicles: Vehicles, width: int
) -> None:
    vehicles["h1"].phase, vehicles["h1"].state = "emergency", "descend"
    vehicles["h2"].counts = {"early_stop": 3, "leader_plan_late": 12}
    vehicles["h2"].diagnostics = {"client": "octave"}
    wait_for(lambda: "octave (external)" in shown(fleet, width), "the client is not shown")
    wait_for(lambda: "descend" in shown(fleet, width), "the phase is not shown")
    states = [vehicle.state for vehicle in fleet]
    text = "".join(shown(fleet, width, page) for page in range(len(pages(states, width))))
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    for words in ("emergency", "descend", "paper", "0.10  0.20  0.30", "early_stop 3", "leader_plan_late"):
        assert words in text


def shown(fleet: Fleet, width: int, page: int = 0) -> str:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(fleet_view(fleet, console.width, page, keys=True))
    return console.export_text()


def test_pages_are_turned_and_begin_again(fleet: Fleet) -> None:
    assert "columns 1 of 4, Tab: others; q: quit" in shown(fleet, 80)
    assert "columns 4 of 4" in shown(fleet, 80, 3)
    assert "columns 1 of 4" in shown(fleet, 80, 4)
    assert "columns" not in shown(fleet, 320)


def test_columns_can_be_chosen_and_a_misspelt_one_is_refused() -> None:
    assert tuple(column.name for column in COLUMNS) == tuple(name for name in COLUMN_NAMES if name != LATENCY)
    assert [column.name for column in columns_named(["solve", "vehicle", "phase"])] == [
        "vehicle", "solve", "phase",
    ]  # fmt: skip
    with pytest.raises(ValueError, match="no column 'battery', known are vehicle, phase"):
        columns_named(["battery"])


def test_the_width_of_chosen_columns_is_known(fleet: Fleet) -> None:
    chosen = columns_named(["phase", "position"])
    assert table_width(fleet, chosen) == 7 + 2 + 9 + 2 + 17 + 2


def test_a_fleet_and_a_state_print_short_and_readable(fleet: Fleet, vehicles: Vehicles) -> None:
    assert repr(fleet) == "<Fleet lab: h1, h2>"
    assert repr(fleet["h1"]) == "<Vehicle h1>"
    assert str(UNHEARD) == "h4: unknown, transmitter unknown"
    assert repr(UNHEARD) == f"<VehicleState {UNHEARD}>"
    line = "ground, transmitter disarmed, flown by paper, leads, at 0.10 0.20 0.30 m, heading 0 deg"
    assert str(fleet) == f"fleet lab\n  h1: {line}\n  h2: {line}"
    vehicles["h2"].diagnostics = {"client": "octave"}
    wait_for(lambda: "flown by octave (external)" in str(fleet["h2"]), "the client is not told")
