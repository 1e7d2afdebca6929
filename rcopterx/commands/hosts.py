"""Preparing hosts: `deploy`, `certs` and `doctor`."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from rcopterx.commands.fleet_option import (
    DEFAULT_FLEET,
    EXIT_FAILED,
    FleetArgument,
    HostOption,
    chosen_host,
    fleet_file,
    wanted_fleet,
)
from rcopterx.commands.parsing import check_known

if TYPE_CHECKING:
    from rcopterx.deploy.doctor.examination import Result
    from rcopterx.fleet.schema import FleetFile


def deploy(
    fleet: FleetArgument,
    wheel: Path,
    only: list[str] | None = None,
    user: str | None = None,
    dry_run: bool = False,
) -> None:
    """Install or update every host over ssh; what is up to date stays as it is.

    Running daemons are not restarted, since that ends flights. Needs keys for ssh, and sudo without a
    password for the systemd unit.
    """
    from rcopterx.deploy.remote.installation import RemoteError, login, on, steps, take, unit_name
    from rcopterx.fleet.reading import fleet_path

    failed = False
    file = fleet_file(fleet)
    path = fleet_path(fleet)
    check_known(only or (), file.hosts, "host", "--host")
    for host in only or file.hosts:
        address = file.hosts[host].address
        run = on(address if user is None else f"{user}@{address}")
        changed = False
        try:
            for step, done in take(run, steps(file, path, host, login(run), wheel), dry=dry_run):
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


def certs(fleet: FleetArgument, renew: bool = False, new_authority: bool = False, days: float = 365) -> None:
    """Make the certificates that a fleet file requires; existing valid ones are kept.

    They are in the directory of security.certificates. The key of the authority stays on this computer; each
    host gets authority.pem and the two files of its own name.
    """
    from datetime import UTC, datetime

    from rcopterx.deploy.certificates.fleet_certificates import make_certificates

    file = fleet_file(fleet)
    for line in make_certificates(
        file, datetime.now(UTC), days, renew=renew or new_authority, new_authority=new_authority
    ):
        typer.echo(line)


def doctor(fleet: str | None = None, host: HostOption = None) -> None:
    """Check this computer, and that the fleet, if it is up, refuses what it must refuse.

    Exit code 1 if there are findings. It does not disturb a fleet: its messages have no content.
    """
    from rcopterx.deploy.hosts.running import running_fleets

    if fleet is None and running_fleets():
        file, here = wanted_fleet(None)
        report_findings(file, host or here)
    else:
        report_findings(fleet_file(fleet or DEFAULT_FLEET), host)


def report_findings(file: "FleetFile", host: str | None) -> None:
    """Print what is wrong with this computer as a host of a fleet; exit code 1 if there is anything."""
    findings = 0
    for result in _results(file, chosen_host(file, host)):
        typer.echo(f"{'ok' if result.good else 'finding'}: {result.text}")
        findings += not result.good
    typer.echo(f"findings: {findings}")
    if findings:
        raise typer.Exit(EXIT_FAILED)


def _results(file: "FleetFile", host: str) -> Iterator["Result"]:
    from datetime import UTC, datetime

    from rcopterx.deploy.certificates.files import directory_of
    from rcopterx.deploy.doctor.examination import Result, examine
    from rcopterx.deploy.hosts.running import running_fleets

    now = datetime.now(UTC)
    yield from examine(file, host, now)
    if (directory := directory_of(file)) is None:
        return
    if (file.name, host) not in {(running.fleet, running.host) for running in running_fleets()}:
        yield Result(True, f"host {host} of fleet {file.name} is not up: access to it was not checked")
        return
    from rcopterx.deploy.doctor.attempts import members, strangers
    from rcopterx.deploy.roles.addresses import bus_address

    yield from strangers(file, host, directory, now)
    yield from members(file, bus_address(file, host), host, directory)
