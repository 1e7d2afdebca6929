"""Files of the certificates of a fleet, and the certificate that this computer shows."""

import os
from pathlib import Path
from typing import Final

from rcopterx.bus.channels import EXTERNAL_INPUT
from rcopterx.bus.endpoints import Credentials
from rcopterx.fleet.schema import FleetError, FleetFile

OUTSIDE: Final = {"agent": "agent", "program": EXTERNAL_INPUT.publisher}
"""Certificates of agents and of programs for external control outside of the hosts: role, by kind of name."""


def host_name(host: str) -> str:
    """Return the name of the certificate of a host: of its router and all of its processes."""
    return f"host.{host}"


def people(fleet: FleetFile) -> list[str]:
    """Return the names of the certificates of operators, then of watchers."""
    groups = (("operator", fleet.security.operators), ("watcher", fleet.security.watchers))
    return [f"{group}.{name}" for group, names in groups for name in names]


def certificate_names(fleet: FleetFile) -> list[str]:
    """Return the names of all certificates of a fleet."""
    outside = [f"{kind}.{vehicle}" for kind in OUTSIDE for vehicle in fleet.vehicles]
    return [*map(host_name, fleet.hosts), *outside, *people(fleet)]


AUTHORITY: Final = "authority"
CHOICE: Final = "RCOPTERX_CERTIFICATE"  # environment variable with the name of the certificate to show


def directory_of(fleet: FleetFile) -> Path | None:
    """Return the directory of the certificates; None for a fleet without them."""
    chosen = fleet.security.certificates
    return None if chosen is None else Path(chosen).expanduser()


def certificate_path(directory: Path, name: str) -> Path:
    """Return the file of a certificate."""
    return directory / f"{name}.pem"


def key_path(directory: Path, name: str) -> Path:
    """Return the file of a private key."""
    return directory / f"{name}.key"


def credentials(directory: Path, name: str) -> Credentials:
    """Return the files that a process needs to show a certificate."""
    return Credentials(
        authority=str(certificate_path(directory, AUTHORITY)),
        certificate=str(certificate_path(directory, name)),
        private_key=str(key_path(directory, name)),
    )


def own_name(fleet: FleetFile, host: str) -> str | None:
    """Return the name of the certificate that this computer shows to the router of a host, if it has one.

    `RCOPTERX_CERTIFICATE` names it (or `FleetError`); else it is that of the host, or the first readable of
    operators, watchers and other hosts.
    """
    if (directory := directory_of(fleet)) is None:
        return None
    if chosen := os.environ.get(CHOICE):
        if not readable(directory, chosen):
            raise FleetError(f"{CHOICE}: {key_path(directory, chosen)} cannot be read")
        return chosen
    names = [host_name(host), *people(fleet), *map(host_name, fleet.hosts)]
    return next((name for name in names if readable(directory, name)), None)


def readable(directory: Path, name: str) -> bool:
    """Whether this user can read a certificate and its key."""
    try:
        for path in (certificate_path(directory, name), key_path(directory, name)):
            path.open("rb").close()
    except OSError:
        return False
    return True


def own_credentials(fleet: FleetFile, host: str) -> Credentials | None:
    """Return the files of the certificate `own_name`; None without one."""
    directory, name = directory_of(fleet), own_name(fleet, host)
    return None if directory is None or name is None else credentials(directory, name)
