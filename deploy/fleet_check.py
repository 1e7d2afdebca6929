"""Checks before any process is started that all can be set up; `python -m` checks a snapshot of a fleet."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.fleet.consistency import check_periods
from rcopterx.fleet.reading import load_fleet, write_snapshot
from rcopterx.fleet.schema import FleetError, FleetFile

MODULE: Final = "rcopterx.deploy.fleet_check"
EXIT_WRONG: Final = 3  # exit code for a fleet with a wrong field


def check_fleet(fleet: FleetFile, directory: Path) -> None:
    """Build the settings of every process with this run directory; `FleetError` names the wrong field."""
    # Imported here: the launcher imports this module, and needs none of the libraries of agents.
    from rcopterx.deploy.roles.agent import pilot_of
    from rcopterx.deploy.roles.ports import check_ports
    from rcopterx.deploy.roles.tracker import tracker_settings
    from rcopterx.deploy.roles.transmitters import gateway_settings
    from rcopterx.fleet.formation_check import check_formation, room_of
    from rcopterx.fleet.vehicle_models import limits_of

    check_periods(fleet)
    for name in fleet.vehicles:
        descend_after_s = limits_of(fleet, name).descend_after_s
        # Else a hung agent is killed only after its vehicle has begun to land.
        if fleet.watchdog.enabled and fleet.watchdog.flight_s >= descend_after_s:
            raise FleetError(
                f"watchdog.flight_s: {fleet.watchdog.flight_s:g} must be shorter than descend_after_s = "
                f"{descend_after_s:g} of {name}, after which it lands without commands"
            )
        pilot_of(fleet, name)
    check_formation(fleet, room_of(fleet))
    check_ports(fleet, directory)
    for gateway in fleet.gateways:
        gateway_settings(fleet, gateway, directory)
    tracker_settings(fleet)
    if fleet.simulator is not None:
        from rcopterx.deploy.roles.simulator import simulator_settings

        simulator_settings(fleet, directory)


def check_in_process(fleet: FleetFile, directory: Path, forks: ForkServer) -> None:
    """As `check_fleet`, in another process: what only agents need does not stay in this one."""
    with TemporaryDirectory(prefix="rcopterx-") as place:
        snapshot, log = Path(place) / "fleet.json", Path(place) / "log"
        write_snapshot(fleet, snapshot)
        code = forks.start([sys.executable, "-m", MODULE, str(snapshot), str(directory)], log).wait()
        output = log.read_text(encoding="utf-8", errors="replace").strip()
    if code == EXIT_WRONG:
        raise FleetError(output)
    if code:
        raise OSError(f"the fleet cannot be checked, exit code {code}: {output}")


def main() -> int:
    """Check a snapshot for a run directory; print what is wrong to the standard error."""
    snapshot, directory = map(Path, sys.argv[1:])
    try:
        check_fleet(load_fleet(snapshot), directory)
    except FleetError as error:
        print(error, file=sys.stderr)
        return EXIT_WRONG
    return 0


if __name__ == "__main__":
    sys.exit(main())
