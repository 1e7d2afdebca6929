"""What a fork server prepares once for the processes that it forks: the fleet, and pilots of its agents.

A forked process shares the memory of the fork server: what was prepared there it neither waits for nor keeps
a second time. Its copy is its own as soon as it changes it. Processes that were not forked find nothing
prepared and read and build for themselves.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetFile

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


def keep(prepared: Prepared | None) -> None:
    """Have this found from now on, instead of what was prepared before."""
    _prepared.clear()
    if prepared is not None:
        _prepared.append(prepared)


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
