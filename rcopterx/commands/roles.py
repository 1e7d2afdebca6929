"""One command per process role, for hosts that start processes by hand or with systemd."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rcopterx.commands.fleet_option import DEFAULT_FLEET, FleetOption, fleet_file

if TYPE_CHECKING:
    from rcopterx.fleet.schema import FleetFile

Host = Annotated[str, typer.Argument(metavar="HOST", help="Host of the fleet file.")]
Gateway = Annotated[str, typer.Argument(metavar="GATEWAY", help="Gateway of the fleet file.")]


def _file(fleet: str) -> "FleetFile":
    """Read a fleet file, for a process that joins its fleet if that is up."""
    from rcopterx.ground_station.scripting.joining import as_running

    return as_running(fleet_file(fleet))


def _run(role: str, unit: str, fleet: str) -> None:
    from rcopterx.deploy.roles.run import run_role

    run_role(role, unit, _file(fleet))


def router(host: Host = "main", fleet: FleetOption = DEFAULT_FLEET) -> None:
    """Run the bus router of a host."""
    _run("router", host, fleet)


def recorder(host: Host = "main", fleet: FleetOption = DEFAULT_FLEET) -> None:
    """Run the recorder: messages of the bus to a flight log."""
    _run("recorder", host, fleet)


def simulator(host: Host = "main", fleet: FleetOption = DEFAULT_FLEET) -> None:
    """Run the simulated laboratory: Tracker, radio modules and vehicles."""
    _run("simulator", host, fleet)


def tracker(
    host: Host = "main",
    record_raw: Annotated[
        Path | None, typer.Option(metavar="FILE", help="New file for the Tracker's raw stream.")
    ] = None,
    fleet: FleetOption = DEFAULT_FLEET,
) -> None:
    """Run the Vicon gateway: motion capture to poses."""
    from rcopterx.deploy.roles.run import check_unit

    file = _file(fleet)
    check_unit(file, "tracker", host)
    # Only what a role needs is imported.
    from rcopterx.deploy.roles.tracker import run

    run(file, host, record_raw)


def transmitters(gateway: Gateway = "transmitters", fleet: FleetOption = DEFAULT_FLEET) -> None:
    """Run a transmitter gateway: commands to radio modules, with the safety arbiter."""
    from rcopterx.deploy.hosts.run_directory import run_directory
    from rcopterx.deploy.hosts.vehicle_states import begin_states
    from rcopterx.deploy.roles.run import check_unit

    file = fleet_file(fleet)
    check_unit(file, "transmitters", gateway)
    begin_states(file.served_by(gateway), run_directory(file.name, file.bus.namespace))
    _run("transmitters", gateway, fleet)


def agent(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Vehicle of the fleet file.")],
    fleet: FleetOption = DEFAULT_FLEET,
) -> None:
    """Run the agent of a vehicle: estimator, controller, plan."""
    _run("agent", vehicle, fleet)
