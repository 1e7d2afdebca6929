"""`doctor`: checks permissions and certificates of this computer, and access to a running fleet."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import typer

from rcopterx.commands.fleet_option import (
    EXIT_FAILED,
    FleetArgument,
    HostOption,
    chosen_host,
    fleet_file,
    user_errors,
)

if TYPE_CHECKING:
    from rcopterx.deploy.doctor.examination import Result
    from rcopterx.fleet.schema import FleetFile


def doctor(fleet: FleetArgument, host: HostOption = None) -> None:
    """Check this computer, and that the fleet, if it is up, refuses what it must refuse.

    Exit code 1 if there are findings. It does not disturb a fleet: its messages have no content.
    """
    with user_errors():
        file = fleet_file(fleet)
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
    directory = directory_of(file)
    if directory is None:
        return
    if (file.name, host) not in {(running.fleet, running.host) for running in running_fleets()}:
        yield Result(True, f"host {host} of fleet {file.name} is not up: access to it was not checked")
        return
    from rcopterx.deploy.doctor.attempts import members, strangers
    from rcopterx.deploy.roles.addresses import bus_address

    yield from strangers(file, host, directory, now)
    yield from members(file, bus_address(file, host), host, directory)
