"""What the fork server imports and builds in advance for its processes; plug-ins are left to them."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rcopterx.agents.tuning.configuration import DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
from rcopterx.deploy.processes.table import ProcessSpec
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.reading import read_snapshot
from rcopterx.fleet.schema import FleetFile, VehicleConfig

if TYPE_CHECKING:
    from rcopterx.agents.pilot import Pilot
    from rcopterx.agents.settings import AgentSettings


PilotBuilder = Callable[[FleetFile, str, str], "tuple[AgentSettings, Pilot]"]


class _Prepared(NamedTuple):
    fleet: FleetFile
    pilots: "dict[tuple[str, str], tuple[AgentSettings, Pilot]]"  # by vehicle and host


_prepared: _Prepared | None = None


def modules_of(fleet: FleetFile, specs: Iterable[ProcessSpec]) -> list[str]:
    """Modules that the fork server imports for these processes."""
    modules = ["rcopterx.deploy.roles.run"]
    for spec in specs:
        modules.append(f"rcopterx.deploy.roles.{spec.role}")
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


def prepare(snapshot: Path, host: str, vehicles: Iterable[str], build: "PilotBuilder") -> None:
    """Build the pilots of vehicles on a host in place of earlier ones; `FleetError` if one cannot be."""
    global _prepared
    _prepared = None
    fleet = read_snapshot(snapshot)
    pilots = {
        (name, host): build(fleet, name, host) for name in vehicles if _is_built_in(fleet.vehicles[name])
    }
    _prepared = _Prepared(fleet, pilots)


def _is_built_in(vehicle: VehicleConfig) -> bool:
    """Whether controller and estimator of a vehicle belong to this package."""
    control = vehicle.control
    modules = CONTROLLERS.built_in_module(control.controller), ESTIMATORS.built_in_module(control.estimator)
    return None not in modules


def prepared_pilot(
    fleet: FleetFile, name: str, host: str | None = None
) -> "tuple[AgentSettings, Pilot] | None":
    """Return the prepared settings and pilot of a vehicle on a host (default: that of the file), if any."""
    if _prepared is None or fleet != _prepared.fleet:
        return None
    return _prepared.pilots.get((name, host or fleet.vehicles[name].host))
