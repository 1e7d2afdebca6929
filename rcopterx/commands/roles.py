"""One command per process role, for hosts that start processes by hand or with systemd."""

from collections.abc import Callable
from typing import Annotated

from typer import Argument

from rcopterx.commands.fleet_option import DEFAULT_FLEET, FleetOption, fleet_file

Host = Annotated[str, Argument(metavar="HOST", help="Host of the fleet file.")]
Gateway = Annotated[str, Argument(metavar="GATEWAY", help="Gateway of the fleet file.")]


def _run(role: str, unit: str, fleet: str) -> None:
    """Run a process, which joins its fleet if that is up."""
    from rcopterx.deploy.roles.run import run_role
    from rcopterx.ground_station.scripting.joining import as_running

    run_role(role, unit, as_running(fleet_file(fleet)))


def _of_host(role: str, text: str) -> Callable[..., None]:

    def run(host: Host = "main", fleet: FleetOption = DEFAULT_FLEET) -> None:
        _run(role, host, fleet)

    run.__doc__ = text
    return run


router = _of_host("router", "Run the bus router of a host.")
recorder = _of_host("recorder", "Run the recorder: messages of the bus to a flight log.")
learner = _of_host("learner", "Run the learner: models of vehicles from their ordinary flight.")
simulator = _of_host("simulator", "Run the simulated laboratory: Tracker, radio modules and vehicles.")
tracker = _of_host("tracker", "Run the Vicon gateway: motion capture to poses.")


def transmitters(gateway: Gateway = "transmitters", fleet: FleetOption = DEFAULT_FLEET) -> None:
    """Run a transmitter gateway: commands to radio modules, with the safety arbiter."""
    from rcopterx.deploy.hosts.run_directory import run_directory
    from rcopterx.deploy.hosts.vehicle_states import begin_states
    from rcopterx.deploy.roles.run import check_unit

    file = fleet_file(fleet)
    check_unit(file, "transmitters", gateway)
    begin_states(file.served_by(gateway), run_directory(file.name, file.bus.namespace))
    _run("transmitters", gateway, fleet)


def agent(vehicle: str, fleet: FleetOption = DEFAULT_FLEET) -> None:
    """Run the agent of a vehicle: estimator, controller, plan."""
    _run("agent", vehicle, fleet)
