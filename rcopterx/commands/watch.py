"""Watching a running fleet: `status`, `check` and `top`."""

import time
from contextlib import suppress
from functools import partial
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import EXIT_FAILED, ROUTER_S, RunningFleetOption, running_fleet
from rcopterx.commands.interruption import until_ctrl_c
from rcopterx.commands.output import JsonOption, print_document
from rcopterx.commands.steer import Vehicles

GATHER_S = 1.0  # time in which commands are collected for a single table of latencies
REFRESH_S = 0.2


def status(as_json: JsonOption = False, fleet: RunningFleetOption = None) -> None:
    """Show the state of every vehicle. Exit code 1 if the fleet is not up."""
    from rcopterx.ground_station.terminal.status import fleet_status, readable

    with running_fleet(fleet) as running:
        running.wait_for_status()
        print_document(fleet_status(running), as_json, partial(readable, vehicles=running))


def check(
    vehicles: Vehicles = None,
    wait: Annotated[
        float, typer.Option(metavar="SECONDS", min=0, help="Longest wait until it is ready.")
    ] = 1.5,
    as_json: JsonOption = False,
    fleet: RunningFleetOption = None,
) -> None:
    """List problems that block take-off. Exit code 1 if there are any."""
    from rcopterx.ground_station.scripting.waiting import NotReachedError
    from rcopterx.ground_station.terminal.status import fleet_check, readable

    with running_fleet(fleet, vehicles, max(ROUTER_S, wait)) as running:
        with suppress(NotReachedError):
            running.wait_ready(vehicles or None, timeout_s=wait)
        table = fleet_check(running, vehicles or None)
    print_document(table, as_json, readable)
    if not table["ready"]:
        raise typer.Exit(EXIT_FAILED)


def top(
    wide: Annotated[bool, typer.Option("--wide", help="Show all columns.")] = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Show the fleet until Ctrl-C, in the columns that fit; without a terminal, show it once."""
    from rich.console import Console
    from rich.live import Live

    from rcopterx.ground_station.terminal.live_table import COLUMNS, FULL_WIDTH, fitting, fleet_view

    console = Console()
    with running_fleet(fleet) as running:
        running.watch_latency()
        running.wait_for_status()
        if not console.is_terminal:
            if wide:
                running.wait(GATHER_S)
                console = Console(width=FULL_WIDTH)
            console.print(fleet_view(running, COLUMNS if wide else fitting(console.width)))
            return
        with (
            until_ctrl_c() as interruption,
            Live(console=console, auto_refresh=False, screen=True) as live,
        ):
            while not interruption.pressed:
                columns = COLUMNS if wide else fitting(console.width)
                live.update(fleet_view(running, columns), refresh=True)
                time.sleep(REFRESH_S)
