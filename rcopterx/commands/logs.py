"""What the processes of a fleet log: `logs`."""

import time
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import EXIT_FAILED, RunningFleetOption, user_errors

FOLLOW_S = 0.2


def logs(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", help="Vehicles or processes, for instance h2 or tracker; all."),
    ] = None,
    follow: Annotated[bool, typer.Option("--follow", help="Go on with new lines until Ctrl-C.")] = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Show what the processes of this computer have logged, merged in time (UTC)."""
    from rcopterx.commands.fleet_option import fleet_file
    from rcopterx.deploy.log_reading import ProcessLogs
    from rcopterx.deploy.run_directory import run_directory
    from rcopterx.ground_station.joining import fleet_that_is_up

    with user_errors():
        file = fleet_that_is_up()[0] if fleet is None else fleet_file(fleet)
    directory = run_directory(file.name, file.bus.namespace) / "log"
    read = ProcessLogs(directory, names or ())
    known = read.processes()
    for name in names or ():
        if name not in known and f"agent-{name}" not in known:
            typer.echo(f"error: {name}: no log in {directory}; there are {', '.join(known)}", err=True)
            raise typer.Exit(EXIT_FAILED)
    width = max((len(process) for process in known), default=0)
    try:
        while True:
            for line in read.new_lines():
                typer.echo(f"{line.time:24} {line.process:{width}} {line.text}")
            if not follow:
                return
            time.sleep(FOLLOW_S)
    except KeyboardInterrupt:
        return
