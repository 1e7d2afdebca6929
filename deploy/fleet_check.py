"""Makes sure that every process of a fleet can be set up before any of them is started."""

from pathlib import Path

from rcopterx.deploy.fleet_file.schema import FleetFile
from rcopterx.deploy.formation_check import check_formation
from rcopterx.deploy.roles.agent import check_period, pilot_of
from rcopterx.deploy.roles.arbiter_limits import limits_of
from rcopterx.deploy.roles.simulator import simulator_settings
from rcopterx.deploy.roles.tracker import tracker_settings
from rcopterx.deploy.roles.transmitters import gateway_settings


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
