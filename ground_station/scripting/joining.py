"""Finding the running fleet, and checking that it is the one that answers."""

from pathlib import Path

from msgspec import structs

from rcopterx.bus.session import Session
from rcopterx.deploy.hosts.running import running_fleets
from rcopterx.fleet.reading import digest_of, load_fleet
from rcopterx.fleet.schema import FleetError, FleetFile


class WrongFleetError(ConnectionError):
    """Another fleet is up than the one that was named, or another version of its file; says which."""


def fleet_that_is_up() -> tuple[FleetFile, str]:
    """The one fleet that is up and the host that this computer is; FleetError for none or several."""
    if not (running := running_fleets()):
        raise FleetError(
            "no fleet is up on this computer; start one (rcopterx up FLEET), "
            "or name the file of one that is up on another computer (-f FLEET)"
        )
    if len({(one.fleet, one.namespace) for one in running}) > 1:
        listed = ", ".join(sorted({one.fleet for one in running}))
        raise FleetError(f"several fleets are up: {listed}; name the file of one (-f FLEET)")
    return load_fleet(Path(running[0].snapshot)), running[0].host


def as_running(file: FleetFile) -> FleetFile:
    """Return a fleet with the time with which it is up on this computer, if it is."""
    for one in running_fleets():
        if (one.fleet, one.namespace) == (file.name, file.bus.namespace) and file.simulator is not None:
            found = structs.replace(file, simulator=load_fleet(Path(one.snapshot)).simulator)
            return file if found == file else found
    return file


def check_identity(session: Session, file: FleetFile) -> None:
    """Check that the linked routers belong to this fleet and to this version of its file.

    A router that is not part of rcopterx does not answer; then only the fleet's name in the keys keeps fleets
    apart. Raises `WrongFleetError`: says which fleet is up.
    """
    digest = digest_of(file)
    for answer in session.identify():
        if answer.fleet != file.name:
            raise WrongFleetError(
                f"fleet {answer.fleet} ({', '.join(answer.vehicles)}) is up at this address, not "
                f"{file.name}; leave out -f to use the fleet that is up"
            )
        if answer.digest != digest:
            raise WrongFleetError(
                f"fleet {file.name} is up with another version of its file ({answer.digest} on host "
                f"{answer.host}, this file is {digest}); leave out -f to use the fleet that is up, or "
                "restart it"
            )
