"""Logs of the processes of a fleet: `logs`."""

import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated

import typer

from rcopterx.commands.fleet_option import RunningFleetOption, failure, user_errors, wanted_fleet
from rcopterx.commands.interruption import until_ctrl_c

if TYPE_CHECKING:
    from rcopterx.fleet.schema import FleetFile
    from rcopterx.ground_station.terminal.fleet_logs import FleetLogs

FOLLOW_S = 0.2


def logs(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...", help="Vehicles or processes, for instance h2 or tracker. Default: all."
        ),
    ] = None,
    follow: Annotated[bool, typer.Option("--follow", help="Show new lines until Ctrl-C.")] = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Show the logs of the processes of a fleet on all its hosts, merged in time (UTC).

    Logs of other hosts are read over the bus; those of this computer also if the fleet is not up.
    """
    with ExitStack() as stack:
        with user_errors():
            file, _ = wanted_fleet(fleet)
            read = _opened(file, names or [], stack)
        for name in names or ():
            if name not in read.processes and f"agent-{name}" not in read.processes:
                there = ", ".join(read.processes)
                raise failure(f"{name}: no log in {read.directory}; there are {there}")
        for host in read.missing:
            typer.echo(f"note: host {host} does not answer: its logs are not here", err=True)
        width = max((len(process) for process in read.processes), default=0)
        place = max((len(host) for host in file.hosts), default=0) if len(file.hosts) > 1 else 0
        with until_ctrl_c() as interruption:
            while not interruption.pressed:
                for host, line in read.new_lines():
                    where = f"{host:{place}} " if place else ""
                    typer.echo(f"{line.time:24} {where}{line.process:{width}} {line.text}")
                if not follow:
                    return
                time.sleep(FOLLOW_S)


def _opened(file: "FleetFile", names: list[str], stack: ExitStack) -> "FleetLogs":
    """The logs of a fleet, those of other computers included if the fleet is up."""
    from rcopterx.ground_station.scripting.daemons import joined_fleet
    from rcopterx.ground_station.terminal.fleet_logs import FleetLogs, hosts_here

    joined = joined_fleet(file) if file.hosts.keys() - hosts_here(file) else None
    if joined is not None:
        stack.callback(joined.close)
    return FleetLogs(file, names, joined)
