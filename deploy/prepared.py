"""What a fork server prepares once for the processes that it forks: the fleet, and pilots of its agents.

A forked process shares the memory of the fork server: what was prepared there it neither waits for nor keeps
a second time. Its copy is its own as soon as it changes it. Processes that were not forked find nothing
prepared and read and build for themselves.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from rcopterx.deploy.fleet_file.reading import load_fleet
from rcopterx.deploy.fleet_file.schema import FleetFile
from rcopterx.deploy.fleet_file.snapshot import snapshot_of

if TYPE_CHECKING:
    from rcopterx.agents.pilot import Pilot
    from rcopterx.agents.settings import AgentSettings

    Built = tuple[AgentSettings, Pilot]


class Prepared(NamedTuple):
    """A fleet and pilots of it.

    Attributes
    ----------
    snapshot
        Where the snapshot of the fleet file lies.
    content
        What it said.
    fleet
        What that means.
    pilots
        Settings and pilot by vehicle and host.
    """

    snapshot: Path
    content: bytes
    fleet: FleetFile
    pilots: "dict[tuple[str, str], Built]"


_prepared: Final[list[Prepared]] = []
"""At most one."""


def prepare(snapshot: Path, host: str, vehicles: Iterable[str]) -> None:
    """Read a fleet and build pilots on a host; what was prepared before is forgotten.

    Controllers and estimators of other packages are not built: what they do when they are built, they shall
    do in agents only.

    Parameters
    ----------
    snapshot
        Snapshot of the fleet file.
    host
        Where the pilots fly; empty for where the fleet file has them.
    vehicles
        Whose pilots are built.

    Raises
    ------
    OSError
        The snapshot cannot be read.
    FleetError
        It is none, or a pilot cannot be built from it.
    """
    # Routers and gateways that were not forked start without agents and numerical libraries.
    from rcopterx.deploy.preloading import is_built_in
    from rcopterx.deploy.roles.agent import pilot_of

    _prepared.clear()
    content = snapshot.read_bytes()
    fleet = snapshot_of(content)
    pilots = {
        (name, host or fleet.vehicles[name].host): pilot_of(fleet, name, host or None)
        for name in vehicles
        if is_built_in(fleet.vehicles[name])
    }
    _prepared.append(Prepared(snapshot, content, fleet, pilots))


def fleet_of(path: Path) -> FleetFile:
    """As `load_fleet`; nothing is done if that very file was prepared and has not changed."""
    for prepared in _prepared:
        if path == prepared.snapshot and path.read_bytes() == prepared.content:
            return prepared.fleet
    return load_fleet(path)


def prepared_pilot(fleet: FleetFile, name: str, host: str | None = None) -> "Built | None":
    """Settings and pilot of a vehicle on a host, by default that of the fleet file, if they were prepared.

    Parameters
    ----------
    fleet
        The very one that was prepared, from `fleet_of`.
    """
    for prepared in _prepared:
        if fleet is prepared.fleet:
            return prepared.pilots.get((name, host or fleet.vehicles[name].host))
    return None
