"""What the fork server imports in advance for its processes; plug-ins are left to them."""

from collections.abc import Iterable

from rcopterx.agents.tuning.configuration import DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
from rcopterx.deploy.processes.table import ProcessSpec
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.schema import FleetFile


def modules_of(fleet: FleetFile, specs: Iterable[ProcessSpec]) -> list[str]:
    """Modules that the fork server imports for these processes."""
    modules = ["rcopterx.deploy.roles.run"]
    for spec in specs:
        modules.append(f"rcopterx.deploy.roles.{spec.role}")
        # What these import at their start only in some fleets.
        if spec.role == "router" and len(fleet.hosts) > 1:
            modules.append("rcopterx.bus.links")
        if spec.role == "router" and fleet.security.certificates is not None:
            modules.append("rcopterx.deploy.certificates.seats")
        if spec.role == "tracker" and fleet.tracker.brand != "vicon":
            modules.append("rcopterx.vicon_gateway.brands")
        if spec.role == "transmitters":
            # Libraries of some take half a second.
            modules += [type(protocol_of(fleet, name)).__module__ for name in fleet.served_by(spec.unit)]
        if spec.role == "agent":
            control = fleet.vehicles[spec.unit].control
            built_in = (
                *map(CONTROLLERS.built_in_module, (DEFAULT_CONTROLLER, control.controller)),
                *map(ESTIMATORS.built_in_module, (DEFAULT_ESTIMATOR, control.estimator)),
            )
            modules += filter(None, built_in)
    return list(dict.fromkeys(modules))
