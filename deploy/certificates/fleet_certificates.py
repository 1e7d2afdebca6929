"""Makes and renews all certificates of a fleet."""

from datetime import datetime

from rcopterx.deploy.certificates.files import AUTHORITY, certificate_names, directory_of, host_name, key_path
from rcopterx.deploy.certificates.issuing import due, issue, problem, read_authority
from rcopterx.deploy.certificates.issuing import new_authority as made_authority
from rcopterx.fleet.schema import FleetError, FleetFile

LOCAL_NAMES = ("127.0.0.1", "localhost")  # further names by which processes of a host reach its router


def make_certificates(
    fleet: FleetFile, now: datetime, days: float, *, renew: bool = False, new_authority: bool = False
) -> list[str]:
    """Make the certificates that are missing, unusable, expire soon, or are for another address; report each.

    `now` has a zone. `days`: validity of new ones. `renew`: issue every one again. `new_authority`: make all
    earlier ones invalid. `FleetError`: no directory, or an unusable authority; `OSError`: unusable files.
    """
    if (directory := directory_of(fleet)) is None:
        raise FleetError(
            "security.certificates: the fleet file names no directory for certificates; for instance "
            f'certificates = "~/.config/rcopterx/{fleet.name}" under [security]'
        )
    lines = []
    try:
        if new_authority or not key_path(directory, AUTHORITY).exists():
            if not new_authority and any(directory.glob("*.pem")):
                raise FleetError(
                    f"{directory}: there are certificates, but not the key of their authority; they were "
                    "made on another computer. Make new ones there, or begin anew by --new-authority"
                )
            authority = made_authority(fleet.name, directory, now)
            lines.append(f"{directory}: new authority; keep {AUTHORITY}.key to yourself")
        elif (why := problem(directory, AUTHORITY, now)) is not None:
            raise FleetError(f"{why}; or begin anew by --new-authority")
        else:
            authority = read_authority(directory)
    except ValueError as error:
        raise FleetError(f"{directory}: {AUTHORITY}: {error}; begin anew by --new-authority") from None
    addresses = {host_name(name): {host.address, *LOCAL_NAMES} for name, host in fleet.hosts.items()}
    for name in certificate_names(fleet):
        own = addresses.get(name, set())
        why = "renewed" if renew else due(directory, name, own, now)
        if why is not None:
            issue(authority, directory, name, own, now, days)
            lines.append(f"{name}: issued ({why}), valid for {days:g} days")
    return lines or [f"{directory}: all certificates are there and valid"]
