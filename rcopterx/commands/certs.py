"""`certs`: certificates for hosts, agents, operators and watchers of a fleet."""

from typing import Annotated

import typer

from rcopterx.commands.fleet_option import FleetArgument, fleet_file, user_errors


def certs(
    fleet: FleetArgument,
    renew: Annotated[bool, typer.Option("--renew", help="Issue all again, with new keys.")] = False,
    new_authority: Annotated[
        bool,
        typer.Option(
            "--new-authority", help="Replace the authority, too: all earlier certificates become invalid."
        ),
    ] = False,
    days: Annotated[float, typer.Option(metavar="DAYS", min=1, help="Validity of the certificates.")] = 365,
) -> None:
    """Make the certificates that a fleet file requires; existing valid ones are kept.

    They are in the directory of security.certificates. The key of the authority stays on this computer; each
    host gets authority.pem and the two files of its own name.
    """
    with user_errors():
        from datetime import UTC, datetime

        from rcopterx.deploy.certificates.fleet_certificates import make_certificates

        file = fleet_file(fleet)
        for line in make_certificates(
            file, datetime.now(UTC), days, renew=renew or new_authority, new_authority=new_authority
        ):
            typer.echo(line)
