"""Makes sure that every process of a fleet can be set up before any of them is started.

`python -m rcopterx.deploy.fleet_check SNAPSHOT DIRECTORY`; see `checking`.
"""

import sys
from pathlib import Path

from rcopterx.deploy.checking import EXIT_WRONG
from rcopterx.deploy.roles.agent import check_period, pilot_of
from rcopterx.deploy.roles.simulator import simulator_settings
from rcopterx.deploy.roles.tracker import tracker_settings
from rcopterx.deploy.roles.transmitters import gateway_settings
from rcopterx.fleet.arbiter_limits import limits_of
from rcopterx.fleet.formation_check import check_formation
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.snapshot import read_snapshot


def check_fleet(fleet: FleetFile, directory: Path) -> None:
    """Build the settings of every process, so that nothing is started from a file with a wrong field.

    Raises
    ------
    FleetError
        Names the field.
    """
    for name in fleet.vehicles:
        check_period(fleet, name)
        pilot_of(fleet, name)
    first = next(iter(fleet.vehicles))
    check_formation(fleet, limits_of(fleet, first).surveillance.minimum_distance_m)
    for gateway in fleet.gateways:
        gateway_settings(fleet, gateway, directory)
    tracker_settings(fleet)
    if fleet.simulator is not None:
        simulator_settings(fleet, directory)


def main() -> int:
    """Check a snapshot for a run directory; what is wrong goes to the standard error."""
    snapshot, directory = map(Path, sys.argv[1:])
    try:
        check_fleet(read_snapshot(snapshot), directory)
    except FleetError as error:
        print(error, file=sys.stderr)
        return EXIT_WRONG
    return 0


if __name__ == "__main__":
    sys.exit(main())
