"""Watching a running fleet: `status`, `check`, `top` and `view`."""

import json
import os
import select
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from typing import Annotated

import typer

from rcopterx.commands.steer import Vehicles, known_vehicles
from rcopterx.fleet_option import EXIT_FAILED, ROUTER_S, RunningFleetOption, running_fleet

QUIT_KEYS = b"qQ\x04"
"""q and Ctrl-D; Ctrl-C comes as a signal."""

VIEW_PERIOD_S = 0.05

JsonOption = Annotated[bool, typer.Option("--json", help="Print a JSON document.")]


def status(as_json: JsonOption = False, fleet: RunningFleetOption = None) -> None:
    """Tell once what every vehicle does. Exit code 1 if the fleet is not up."""
    from ground_station.status import fleet_status, readable

    with running_fleet(fleet) as running:
        running.wait_for_status()
        table = fleet_status(running)
    typer.echo(json.dumps(table, indent=2) if as_json else readable(table))


def check(
    vehicles: Vehicles = None,
    wait: Annotated[
        float, typer.Option(metavar="SECONDS", min=0, help="Wait so long for everything to be ready.")
    ] = 1.5,
    as_json: JsonOption = False,
    fleet: RunningFleetOption = None,
) -> None:
    """List what blocks take-off. Exit code 0 if nothing does, 1 otherwise."""
    from ground_station.status import fleet_check, readable
    from ground_station.waiting import NotReachedError

    with running_fleet(fleet, router_within_s=max(ROUTER_S, wait)) as running:
        known_vehicles(running.file.vehicles, vehicles)
        with suppress(NotReachedError):
            running.wait_ready(vehicles or None, timeout_s=wait)
        table = fleet_check(running, vehicles or None)
    typer.echo(json.dumps(table, indent=2) if as_json else readable(table))
    if not table["ready"]:
        raise typer.Exit(EXIT_FAILED)


def top(
    period: Annotated[
        float, typer.Option(metavar="SECONDS", min=0.05, help="Time between two pictures in seconds.")
    ] = 0.2,
    fleet: RunningFleetOption = None,
) -> None:
    """Show the fleet until q or Ctrl-C; without a terminal, show it once."""
    from rich.console import Console
    from rich.live import Live

    from ground_station.live_table import fleet_view

    console = Console()
    with running_fleet(fleet) as running:
        running.wait_for_status()
        if not console.is_terminal:
            console.print(fleet_view(running))
            return
        picture = Live(fleet_view(running), console=console, auto_refresh=False, screen=True)
        with suppress(KeyboardInterrupt), picture, keys() as quit_within:
            while not quit_within(period):
                picture.update(fleet_view(running), refresh=True)


def view(
    port: Annotated[
        int, typer.Option(metavar="PORT", min=1, max=65535, help="Port of the web page on this computer.")
    ] = 8080,
    fleet: RunningFleetOption = None,
) -> None:
    """Show the fleet in the browser until Ctrl-C; set points of leaders can be dragged."""
    if find_spec("viser") is None:
        typer.echo("error: the browser view needs viser: pip install 'rcopterx[ground]'", err=True)
        raise typer.Exit(EXIT_FAILED)
    import viser

    from ground_station.view import FleetView

    with running_fleet(fleet) as running:
        server = viser.ViserServer("127.0.0.1", port, label=f"rcopterx {running.file.name}", verbose=False)
        try:
            with suppress(KeyboardInterrupt):
                picture = FleetView(running, server)
                typer.echo(f"http://127.0.0.1:{server.get_port()}  (Ctrl-C ends the view, the fleet goes on)")
                while True:
                    picture.update()
                    time.sleep(VIEW_PERIOD_S)
        finally:
            server.stop()


@contextmanager
def keys() -> Iterator[Callable[[float], bool]]:
    """Wait for single keys of the terminal, without Enter; its settings come back at the end.

    Yields
    ------
    Callable
        Waits a time [s]; True as soon as the user wants to quit, or hung up.
    """
    descriptor = sys.stdin.fileno()
    if not os.isatty(descriptor):
        yield threading.Event().wait
        return
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    try:
        yield lambda seconds: _quit_within(descriptor, seconds)
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _quit_within(descriptor: int, seconds: float) -> bool:
    ready, _, _ = select.select([descriptor], [], [], seconds)
    if not ready:
        return False
    typed = os.read(descriptor, 64)
    return not typed or any(key in QUIT_KEYS for key in typed)
