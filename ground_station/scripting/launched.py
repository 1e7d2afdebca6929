"""Starting a fleet from a program: processes up, fly, land, processes down."""

from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from rcopterx.bus.processes import SCRIPT
from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.fleet.reading import at_speed, fleet_path, load_fleet
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.observer import STARTED_S

FIRST_ROUTER_S = 15.0


@contextmanager
def launched(
    path: str | Path,
    host: str | None = None,
    without: Collection[str] = (),
    *,
    watchdog: bool = True,
    record: bool = True,
    speed: float | None = None,
    lockstep: bool = False,
) -> Iterator[Fleet]:
    """Start the processes of a fleet on this computer and join it; at the end everything lands and stops.

    `path` is a fleet file, or the name of a shipped fleet, for instance `trio`. `host` is the host of the
    fleet file that this computer is, needed where there are several. Vehicles in `without` can join later
    (`Fleet.join`). The watchdog restarts processes that hang. `rcopterx flights` lists the recorded logs. The
    fleet that is yielded is ready to take off; it lands at the end of the block and on any exception. With
    `speed` 0.2 the time of a simulated fleet passes five times slower than real time; None means as in its
    file. In `lockstep` it stands still until all processes have finished their work, and while the block does
    not wait. Raises `FleetError`: the file is wrong, an address is in use, a device is missing, or the fleet
    cannot fly at that speed; nothing was started. Raises `NotReachedError`: the fleet did not become ready;
    says what is missing.
    """
    file = at_speed(load_fleet(fleet_path(str(path))), speed, lockstep)
    if host is None and len(file.hosts) > 1:
        raise FleetError(f"this fleet has several hosts, name one of {', '.join(file.hosts)}")
    with (
        processes_up(
            file, host or next(iter(file.hosts)), without, watchdog=watchdog, record=record, script=SCRIPT
        ) as fleet,
        fleet,
    ):
        fleet.wait_ready(timeout_s=STARTED_S)
        yield fleet
        if any(vehicle.state.airborne for vehicle in fleet):
            fleet.land()


@contextmanager
def processes_up(
    file: FleetFile,
    host: str,
    without: Collection[str] = (),
    *,
    watchdog: bool = True,
    record: bool = True,
    script: str = "",
) -> Iterator[Fleet]:
    """Start the processes of a host and join their fleet; at the end the processes stop, landed or not.

    The processes may still be starting when the fleet is yielded. For arguments and errors see `Launcher`. In
    lockstep this program takes turns as `script`; without this name it only follows the time.
    """
    with (
        Launcher(file, host, without, watchdog=watchdog, record=record, script=script) as launcher,
        closing(Fleet(file, host, FIRST_ROUTER_S, process=script)) as fleet,
    ):
        fleet.launcher = launcher
        yield fleet
