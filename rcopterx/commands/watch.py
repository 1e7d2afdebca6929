"""Watching a running fleet: `status`, `check`, `top` and `logs`."""

import time
from contextlib import closing, nullcontext, suppress
from functools import partial

import typer

from rcopterx.commands.fleet_option import (
    EXIT_FAILED,
    ROUTER_S,
    RunningFleetOption,
    failure,
    fleet_file,
    running_fleet,
    wanted_fleet,
)
from rcopterx.commands.interruption import until_ctrl_c
from rcopterx.commands.output import JsonOption, print_document
from rcopterx.commands.steer import Vehicles

GATHER_S = 1.0  # time in which commands are collected for a single table of latencies
REFRESH_S = 0.2
FOLLOW_S = 0.2


def status(as_json: JsonOption = False, fleet: RunningFleetOption = None) -> None:
    """Show the state of every vehicle. Exit code 1 if the fleet is not up."""
    from rcopterx.ground_station.terminal.status import fleet_status, readable

    with running_fleet(fleet) as running:
        running.wait_for_status()
        print_document(fleet_status(running), as_json, partial(readable, vehicles=running))


def check(
    vehicles: Vehicles = None,
    wait: float = 1.5,
    as_json: JsonOption = False,
    fleet: RunningFleetOption = None,
) -> None:
    """List problems that block take-off. Exit code 1 if there are any.

    With the name of a fleet file (*.toml) instead of vehicles, check the file and this computer.
    """
    if vehicles and len(vehicles) == 1 and vehicles[0].endswith(".toml"):
        _check_file(vehicles[0])
        return
    from rcopterx.ground_station.scripting.waiting import NotReachedError
    from rcopterx.ground_station.terminal.status import fleet_check, readable

    with running_fleet(fleet, vehicles, max(ROUTER_S, wait)) as running:
        with suppress(NotReachedError):
            running.wait_ready(vehicles or None, timeout_s=wait)
        table = fleet_check(running, vehicles or None)
    print_document(table, as_json, readable)
    if not table["ready"]:
        raise typer.Exit(EXIT_FAILED)


def _check_file(name: str) -> None:
    """Check a fleet file and this computer without starting a process of the fleet."""
    from rcopterx.commands.hosts import report_findings
    from rcopterx.deploy.fleet_check import check_fleet
    from rcopterx.deploy.hosts.run_directory import run_directory

    file = fleet_file(name)
    check_fleet(file, run_directory(file.name, file.bus.namespace))
    typer.echo(f"ok: {name}: {len(file.vehicles)} vehicles, every field is valid")
    if len(file.hosts) == 1:
        report_findings(file, None)
    else:
        typer.echo(f"on each of {', '.join(file.hosts)}: rcopterx doctor {name} --host HOST")


def top(wide: bool = False, fleet: RunningFleetOption = None) -> None:
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
        with until_ctrl_c() as interrupts, Live(console=console, auto_refresh=False, screen=True) as live:
            while not interrupts.is_set():
                live.update(fleet_view(running, COLUMNS if wide else fitting(console.width)), refresh=True)
                time.sleep(REFRESH_S)


def logs(names: list[str] | None = None, follow: bool = False, fleet: RunningFleetOption = None) -> None:
    """Show the logs of the processes of a fleet on all its hosts, merged in time (UTC).

    Logs of other hosts are read over the bus; those of this computer also if the fleet is not up.
    """
    from rcopterx.ground_station.scripting.daemons import joined_fleet
    from rcopterx.ground_station.terminal.fleet_logs import FleetLogs, hosts_here

    file, _ = wanted_fleet(fleet)
    joined = joined_fleet(file) if file.hosts.keys() - hosts_here(file) else None
    with nullcontext() if joined is None else closing(joined):
        read = FleetLogs(file, names or [], joined)
        for name in names or ():
            if name not in read.processes and f"agent-{name}" not in read.processes:
                there = ", ".join(read.processes)
                raise failure(f"{name}: no log in {read.directory}; there are {there}")
        for host in read.missing:
            typer.echo(f"note: host {host} does not answer: its logs are not here", err=True)
        width = max((len(process) for process in read.processes), default=0)
        place = max((len(host) for host in file.hosts), default=0) if len(file.hosts) > 1 else 0
        with until_ctrl_c() as interrupts:
            while not interrupts.is_set():
                for host, line in read.new_lines():
                    where = f"{host:{place}} " if place else ""
                    typer.echo(f"{line.time:24} {where}{line.process:{width}} {line.text}")
                if not follow:
                    return
                time.sleep(FOLLOW_S)
