"""Watching a running fleet: `status`, `check` and `top`."""

import os
import select
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Annotated

import typer

from rcopterx.commands.fleet_option import EXIT_FAILED, ROUTER_S, RunningFleetOption, running_fleet
from rcopterx.commands.output import JsonOption, print_document
from rcopterx.commands.steer import Vehicles

if TYPE_CHECKING:
    from rich.console import Group

GATHER_S = 1.0
"""Time in which commands are collected for a single table of latencies."""
LATENCY_COLUMN = "-ms"
HUNG_UP = b"\x04"
QUIT_KEYS = b"qQ" + HUNG_UP
"""q and Ctrl-D; Ctrl-C comes as a signal."""
NEXT_KEY = b"\t"
COLUMN_NAMES = (
    "vehicle", "phase", "arbiter", "flown-by", "follows", "position", "error", "pose", "command", "missed",
    "solve", "link", "events", "latency", "total-ms", "tracker-ms", "gateway-ms", "agent-ms", "solver-ms",
    "command-ms", "radio-ms",
)  # fmt: skip


def status(as_json: JsonOption = False, fleet: RunningFleetOption = None) -> None:
    """Show the state of every vehicle. Exit code 1 if the fleet is not up."""
    from rcopterx.ground_station.terminal.status import fleet_status, readable

    with running_fleet(fleet) as running:
        running.wait_for_status()
        table = fleet_status(running)
    print_document(table, as_json, readable)


def check(
    vehicles: Vehicles = None,
    wait: Annotated[
        float, typer.Option(metavar="SECONDS", min=0, help="Longest wait until the fleet is ready.")
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
    period: Annotated[
        float, typer.Option(metavar="SECONDS", min=0.05, help="Time between two updates in seconds.")
    ] = 0.2,
    columns: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,...",
            help=f"Show these columns: {', '.join(COLUMN_NAMES)}. Default: as many as fit.",
        ),
    ] = None,
    wide: Annotated[
        bool, typer.Option("--wide", help="Show all columns, however wide the terminal is.")
    ] = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Show the fleet until q or Ctrl-C, further columns with Tab; without a terminal, show it once."""
    from rich.console import Console
    from rich.live import Live

    from rcopterx.ground_station.terminal.live_table import COLUMNS, columns_named, fleet_view, table_width

    try:
        chosen = COLUMNS if wide else columns and columns_named(columns.split(","))
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--columns") from None
    console = Console()
    with running_fleet(fleet) as running:
        running.watch_latency()
        running.wait_for_status()
        if not console.is_terminal:
            if chosen and any(column.name.endswith(LATENCY_COLUMN) for column in chosen):
                time.sleep(GATHER_S)
            width = table_width(running, chosen) if chosen else console.width
            Console(width=width).print(fleet_view(running, width, columns=chosen or None))
            return

        def picture(page: int) -> "Group":
            return fleet_view(running, console.width, page, chosen or None, keys=True)

        page, typed = 0, b""
        live = Live(picture(page), console=console, auto_refresh=False, screen=True)
        with suppress(KeyboardInterrupt), keys() as typed_within, live:
            while not any(key in QUIT_KEYS for key in typed):
                page += typed.count(NEXT_KEY)
                live.update(picture(page), refresh=True)
                typed = typed_within(period)


@contextmanager
def keys() -> Iterator[Callable[[float], bytes]]:
    """Read single keys of the terminal, without Enter, and restore its settings at the end.

    The function that is yielded waits a time [s] and returns the typed keys, Ctrl-D at the end of the input.
    """
    descriptor = sys.stdin.fileno()
    if not os.isatty(descriptor):
        yield nothing_within
        return
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    try:
        yield lambda seconds: _typed_within(descriptor, seconds)
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def nothing_within(seconds: float) -> bytes:
    """Wait without a keyboard."""
    time.sleep(seconds)
    return b""


def _typed_within(descriptor: int, seconds: float) -> bytes:
    ready, _, _ = select.select([descriptor], [], [], seconds)
    return (os.read(descriptor, 64) or HUNG_UP) if ready else b""
