"""Pages of shared memory in which the transmitter gateways of a host keep the states of their vehicles."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

from rcopterx.deploy.hosts.run_directory import LOCKSTEP, states_directories, states_directory
from rcopterx.fleet.schema import FleetError
from rcopterx.transmitter_gateway.state_page import StatePage, begin_page, open_page

OWNER: Final = ".run"  # link from a directory of pages to its run directory; no vehicle can have this name


def begin_states(vehicles: Iterable[str], directory: Path) -> None:
    """Make the pages of vehicles valid before their gateways start; remove those of fleets that are gone.

    A valid page of an earlier flight stays. Raises `FleetError`: a page cannot be used; names it.
    """
    states = states_directory(directory)
    _remove_abandoned(states)
    for name in vehicles:
        _begun(states / name).close()
    with suppress(OSError):
        (states / OWNER).symlink_to(directory.absolute())


def reserved_state(vehicle: str, directory: Path) -> StatePage:
    """Return the page of a vehicle that no gateway can serve until it is closed; as `begin_states`."""
    begin_states([vehicle], directory)
    return _begun(states_directory(directory) / vehicle)


def _begun(path: Path) -> StatePage:
    where = f"vehicles.{path.name}"
    try:
        return begin_page(path)
    except BlockingIOError:
        raise FleetError(f"{where}: another transmitter gateway or workbench command serves it") from None
    except OSError as error:
        raise FleetError(f"{where}: its state cannot be kept in {path}: {error}") from None


def remove_states(vehicles: Iterable[str], directory: Path) -> None:
    """Remove the pages of vehicles whose gateways have ended, and with them latched kills."""
    states = states_directory(directory)
    for name in vehicles:
        (states / name).unlink(missing_ok=True)
    with suppress(OSError):
        _remove_empty(states)


def _remove_abandoned(own: Path) -> None:
    """Remove what launchers that were killed have left, except where a gateway still runs."""
    for states in states_directories():
        owner = states / OWNER
        with suppress(OSError):
            if states == own or not owner.is_symlink() or owner.exists():
                continue
            for page in states.iterdir():
                if page == owner:
                    continue
                if not page.name.startswith(LOCKSTEP):
                    open_page(page).close()
                page.unlink()
            _remove_empty(states)


def _remove_empty(states: Path) -> None:
    if [path.name for path in states.iterdir()] == [OWNER]:
        (states / OWNER).unlink()
    states.rmdir()
