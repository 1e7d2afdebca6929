"""`deploy`: software, fleet file, certificates and systemd unit for every host, over ssh."""

from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import EXIT_FAILED, FleetArgument, fleet_file, user_errors
from rcopterx.commands.parsing import check_known


def deploy(
    fleet: FleetArgument,
    wheel: Annotated[
        Path,
        typer.Option(
            metavar="FILE", exists=True, dir_okay=False, help="Wheel of the software, from make wheel."
        ),
    ],
    only: Annotated[
        list[str] | None, typer.Option("--host", metavar="HOST", help="Only this host. May be repeated.")
    ] = None,
    user: Annotated[
        str | None, typer.Option(metavar="USER", help="User to log in as. Default: that of ssh.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only show what would be done.")] = False,
) -> None:
    """Install or update every host over ssh; what is up to date stays as it is.

    Running daemons are not restarted, since that ends flights. Needs keys for ssh, and sudo without a
    password for the systemd unit.
    """
    from rcopterx.deploy.remote.plan import steps, unit_name
    from rcopterx.deploy.remote.ssh import RemoteError, login, on, take
    from rcopterx.fleet.reading import fleet_path

    failed = False
    with user_errors():
        file = fleet_file(fleet)
        text = fleet_path(fleet).read_bytes()
        check_known(only or (), file.hosts, "host", "--host")
        for host in only or file.hosts:
            address = file.hosts[host].address
            run = on(address if user is None else f"{user}@{address}")
            changed = False
            try:
                for step, done in take(run, steps(file, text, host, login(run), wheel), dry=dry_run):
                    changed = changed or not done
                    typer.echo(f"{host}: {'there' if done else 'to do' if dry_run else 'done'}: {step.what}")
            except RemoteError as error:
                typer.echo(f"error: {host}: {error}", err=True)
                failed = True
                continue
            if changed and not dry_run:
                typer.echo(f"{host}: while nothing flies: sudo systemctl restart {unit_name(file)}")
    if failed:
        raise typer.Exit(EXIT_FAILED)
