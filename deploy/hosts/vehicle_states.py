"""Pages of shared memory in which the transmitter gateways of a host keep the states of their vehicles."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from rcopterx.deploy.hosts.run_directory import states_directory
from rcopterx.fleet.schema import FleetError
from rcopterx.transmitter_gateway.state_page import begin_page


def begin_states(vehicles: Iterable[str], directory: Path) -> None:
    """Make the pages of vehicles valid before their gateways start; a valid page of an earlier flight stays.

    Parameters
    ----------
    directory
        Run directory of the fleet.

    Raises `FleetError`: a page cannot be used; names it.
    """
    for name in vehicles:
        path = states_directory(directory) / name
        try:
            begin_page(path)
        except BlockingIOError:
            raise FleetError(f"vehicles.{name}: another transmitter gateway serves it") from None
        except OSError as error:
            raise FleetError(f"vehicles.{name}: its state cannot be kept in {path}: {error}") from None


def remove_states(vehicles: Iterable[str], directory: Path) -> None:
    """Remove the pages of vehicles whose gateways have ended, and with them latched kills."""
    states = states_directory(directory)
    for name in vehicles:
        (states / name).unlink(missing_ok=True)
    with suppress(OSError):
        states.rmdir()
