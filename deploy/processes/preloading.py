"""What a fork server imports and builds before it forks the processes of a host.

Controllers and estimators of other packages are not among it: what they do when they are imported and built,
they shall do in agents only.
"""

from collections.abc import Iterable
from pathlib import Path

from rcopterx.agents.tuning.configuration import DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR
from rcopterx.control.controllers.registry import CONTROLLERS
from rcopterx.control.estimators.registry import ESTIMATORS
from rcopterx.deploy.processes.prepared import Prepared, keep
from rcopterx.deploy.processes.table import ProcessSpec
from rcopterx.fleet.schema import FleetFile, VehicleConfig
from rcopterx.fleet.snapshot import snapshot_of


def modules_of(fleet: FleetFile, specs: Iterable[ProcessSpec]) -> list[str]:
    """Modules that processes share because they were imported before these were forked."""
    modules: dict[str, None] = dict.fromkeys(
        ("rcopterx.deploy.roles.run", "rcopterx.deploy.spares.spare_process")
    )
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


def prepare(snapshot: Path, host: str, vehicles: Iterable[str]) -> None:
    """Read a fleet and build pilots on a host; what was prepared before is forgotten.

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
    # Who only names modules imports no agents.
    from rcopterx.deploy.roles.agent import pilot_of

    keep(None)
    content = snapshot.read_bytes()
    fleet = snapshot_of(content)
    pilots = {
        (name, host or fleet.vehicles[name].host): pilot_of(fleet, name, host or None)
        for name in vehicles
        if _is_built_in(fleet.vehicles[name])
    }
    keep(Prepared(snapshot, content, fleet, pilots))


def _is_built_in(vehicle: VehicleConfig) -> bool:
    """Whether neither controller nor estimator of a vehicle is another package's."""
    control = vehicle.control
    modules = (
        CONTROLLERS.built_in_module(control.controller),
        ESTIMATORS.built_in_module(control.estimator),
    )
    return None not in modules
