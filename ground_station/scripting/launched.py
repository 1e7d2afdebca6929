"""Starting a fleet from a program: processes up, fly, land, processes down."""

from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.shipped import fleet_path
from rcopterx.ground_station.scripting.fleet import Fleet

FIRST_ROUTER_S = 15.0


@contextmanager
def launched(
    path: str | Path,
    host: str | None = None,
    without: Collection[str] = (),
    *,
    watchdog: bool = True,
    record: bool = True,
) -> Iterator[Fleet]:
    """Start the processes of a fleet on this computer and join it; at the end everything lands and stops.

    Parameters
    ----------
    path
        Fleet file, or the name of a shipped fleet, for instance `trio`.
    host
        Which host of the fleet file this computer is; may be left out where there is only one.
    without
        Vehicles that do not take part at first; `Fleet.join` lets them.
    watchdog
        Whether processes that hang are ended and started again.
    record
        Whether a flight log is written; `rcopterx flights` lists them.

    Yields
    ------
    Fleet
        Ready to take off. Whatever leaves the block lands it first.

    Raises
    ------
    FleetError
        Something in the file is wrong, an address is in use, a device is missing; nothing was started.
    NotReachedError
        Something kept missing; says what.
    """
    file = load_fleet(fleet_path(str(path)))
    if host is None and len(file.hosts) > 1:
        raise FleetError(f"this fleet has several hosts, name one of {', '.join(file.hosts)}")
    with (
        processes_up(
            file, host or next(iter(file.hosts)), without, watchdog=watchdog, record=record
        ) as fleet,
        fleet,
    ):
        fleet.wait_ready()
        yield fleet
        if any(vehicle.state.airborne for vehicle in fleet):
            fleet.land()


@contextmanager
def processes_up(
    file: FleetFile, host: str, without: Collection[str] = (), *, watchdog: bool = True, record: bool = True
) -> Iterator[Fleet]:
    """Start the processes of a host and join their fleet; at the end the processes stop, landed or not.

    Parameters
    ----------
    file, host, without, watchdog, record
        See `Launcher`, also for the errors.

    Yields
    ------
    Fleet
        With its `launcher`; its processes may still be starting.
    """
    with (
        Launcher(file, host, without, watchdog=watchdog, record=record) as launcher,
        closing(Fleet(file, host, FIRST_ROUTER_S)) as fleet,
    ):
        fleet.launcher = launcher
        yield fleet
