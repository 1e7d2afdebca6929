"""Where the certificates of a fleet lie, and which of them this computer shows."""

import os
from dataclasses import astuple
from pathlib import Path
from typing import Final

from rcopterx.bus.endpoints import Credentials
from rcopterx.deploy.certificates.names import host_name, people
from rcopterx.fleet.schema import FleetError, FleetFile

AUTHORITY: Final = "authority"
CHOICE: Final = "RCOPTERX_CERTIFICATE"
"""Environment variable that names the certificate to show, for whoever has several."""


def directory_of(fleet: FleetFile) -> Path | None:
    """Directory of the certificates; None for a fleet without them."""
    chosen = fleet.security.certificates
    return None if chosen is None else Path(chosen).expanduser()


def certificate_path(directory: Path, name: str) -> Path:
    """File of a certificate."""
    return directory / f"{name}.pem"


def key_path(directory: Path, name: str) -> Path:
    """File of a private key."""
    return directory / f"{name}.key"


def credentials(directory: Path, name: str) -> Credentials:
    """Files by which a process shows a certificate."""
    return Credentials(
        authority=str(certificate_path(directory, AUTHORITY)),
        certificate=str(certificate_path(directory, name)),
        private_key=str(key_path(directory, name)),
    )


def own_name(fleet: FleetFile, host: str) -> str | None:
    """Which certificate processes of this computer show to routers that ask for one.

    What `RCOPTERX_CERTIFICATE` names; else that of the host, or of the first operator, watcher, or other host
    whose key can be read here.

    Parameters
    ----------
    fleet
        The fleet file.
    host
        Host whose router is looked for.

    Raises
    ------
    FleetError
        What is named cannot be read.
    """
    directory = directory_of(fleet)
    if directory is None:
        return None
    chosen = os.environ.get(CHOICE)
    if chosen:
        if not readable(directory, chosen):
            raise FleetError(f"{CHOICE}: {key_path(directory, chosen)} cannot be read")
        return chosen
    names = [host_name(host), *people(fleet), *map(host_name, fleet.hosts)]
    return next((name for name in names if readable(directory, name)), None)


def readable(directory: Path, name: str) -> bool:
    """Whether a certificate and its key are here, for this user."""
    return all(
        os.access(path, os.R_OK) for path in (certificate_path(directory, name), key_path(directory, name))
    )


def own_credentials(fleet: FleetFile, host: str) -> Credentials | None:
    """What processes of this computer show; None in a fleet without certificates, or where none is here.

    Raises
    ------
    FleetError
        See `own_name`.
    """
    directory, name = directory_of(fleet), own_name(fleet, host)
    return None if directory is None or name is None else credentials(directory, name)


def shown(fleet: FleetFile, host: str) -> list[str] | None:
    """As `own_credentials`, for records of running fleets."""
    own = own_credentials(fleet, host)
    return None if own is None else list(astuple(own))
