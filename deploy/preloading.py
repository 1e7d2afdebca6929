"""What a fork server imports before it forks the processes of a host."""

from collections.abc import Iterable

from rcopterx.agents.controllers.registry import CONTROLLERS
from rcopterx.agents.estimators.registry import ESTIMATORS
from rcopterx.agents.tuning.configuration import DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR
from rcopterx.deploy.fleet_file.schema import FleetFile, VehicleConfig
from rcopterx.deploy.processes import ProcessSpec


def modules_of(fleet: FleetFile, specs: Iterable[ProcessSpec]) -> list[str]:
    """Modules that processes share because they were imported before these were forked.

    Controllers and estimators of other packages are not among them: what they do when they are imported,
    they shall do in agents only.
    """
    modules: dict[str, None] = dict.fromkeys(("rcopterx.deploy.roles.run", "rcopterx.deploy.spare_process"))
    for spec in specs:
        modules[f"rcopterx.deploy.roles.{spec.role}"] = None
        if spec.role != "agent":
            continue
        control = fleet.vehicles[spec.unit].control
        for module in (
            *map(CONTROLLERS.built_in_module, (DEFAULT_CONTROLLER, control.controller)),
            *map(ESTIMATORS.built_in_module, (DEFAULT_ESTIMATOR, control.estimator)),
        ):
            if module is not None:
                modules[module] = None
    return list(modules)


def is_built_in(vehicle: VehicleConfig) -> bool:
    """Whether neither controller nor estimator of a vehicle is another package's."""
    control = vehicle.control
    modules = (
        CONTROLLERS.built_in_module(control.controller),
        ESTIMATORS.built_in_module(control.estimator),
    )
    return None not in modules
