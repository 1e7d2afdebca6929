"""The role of a vehicle's agent: its settings and its pilot from the fleet file."""

import logging
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from rcopterx.agents.assembly import build_pilot
from rcopterx.agents.flight.vehicle_watch import HoverThrustLimits
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.process import run_agent
from rcopterx.agents.separation.avoidance import SeparationEllipsoid
from rcopterx.agents.settings import AgentSettings
from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
from rcopterx.deploy.processes.table import EXIT_ELSEWHERE, agent_process
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.formation_check import room_of
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetError, FleetFile, errors_at
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.formation.succession import Succession

_Pilots = dict[tuple[str, str], tuple[AgentSettings, Pilot]]  # by vehicle and host
_prepared: tuple[FleetFile, _Pilots] | None = None  # in the fork server and the processes that it starts


def fly(settings: AgentSettings, pilot: Pilot, *, take_over: bool = False) -> None:
    """Fly a vehicle; exit with `EXIT_ELSEWHERE` if another agent flies it."""
    if run_agent(replace(settings, take_over=take_over), pilot):
        logging.getLogger(__name__).info("agent %s: another agent flies it", settings.vehicle)
        sys.exit(EXIT_ELSEWHERE)


def ready_pilot(fleet: FleetFile, name: str, host: str | None = None) -> tuple[AgentSettings, Pilot]:
    """As `pilot_of`, but return the pilot that the fork server has prepared, if any."""
    return prepared_pilot(fleet, name, host) or pilot_of(fleet, name, host)


def prepare(snapshot: Path, host: str, vehicles: Iterable[str]) -> None:
    """Build pilots of a host in place of earlier ones, except those with plug-ins; may raise `FleetError`."""
    global _prepared
    _prepared = None
    fleet, pilots = load_fleet(snapshot), _Pilots()
    for name in vehicles:
        control = fleet.vehicles[name].control
        if control.controller in CONTROLLERS.built_in and control.estimator in ESTIMATORS.built_in:
            pilots[name, host] = pilot_of(fleet, name, host)
    _prepared = fleet, pilots


def prepared_pilot(
    fleet: FleetFile, name: str, host: str | None = None
) -> tuple[AgentSettings, Pilot] | None:
    """Return the prepared settings and pilot of a vehicle on a host (default: that of the file), if any."""
    if _prepared is None or fleet != _prepared[0]:
        return None
    return _prepared[1].get((name, host or fleet.vehicles[name].host))


def pilot_of(fleet: FleetFile, name: str, host: str | None = None) -> tuple[AgentSettings, Pilot]:
    """Build settings and pilot of a vehicle's agent on a host, by default the file's; `FleetError`."""
    settings = agent_settings(fleet, name, host)
    with errors_at(f"vehicles.{name}.control", ValueError):
        return settings, build_pilot(settings)


def configured(fleet: FleetFile, name: str) -> Configuration:
    """Return the controller and the estimator that the fleet file configures for a vehicle."""
    control = fleet.vehicles[name].control
    settings = {"horizon": control.horizon, **control.settings}
    return Configuration(control.controller, control.estimator, settings, control.estimator_settings)


def agent_settings(fleet: FleetFile, name: str, host: str | None = None) -> AgentSettings:
    """Return the settings of a vehicle's agent on a host, by default that of the fleet file."""
    vehicle = fleet.vehicles[name]
    control, avoidance = vehicle.control, fleet.avoidance
    models = {other: model_of(fleet, other) for other in fleet.vehicles}
    ellipsoid = SeparationEllipsoid(avoidance.horizontal_m, avoidance.vertical_m)
    return AgentSettings(
        bus=bus_address(fleet, host or vehicle.host, agent_process(name)),
        vehicle=name,
        vehicles=tuple(fleet.tracked),
        model=models[name],
        room=room_of(fleet, name),
        configuration=configured(fleet, name),
        period_s=control.period_s,
        leader_wait_s=control.leader_wait_s,
        deviation_share=control.deviation_share,
        following=tuple(vehicle.follow),
        models=models,
        succession=succession_of(fleet, name),
        separation=ellipsoid if avoidance.enabled else None,
        hover_thrust_limits=hover_thrust_limits_of(fleet, name),
        realtime_priority=(Priority.FOLLOWER if vehicle.follow else Priority.LEADER).of(fleet),
    )


def hover_thrust_limits_of(fleet: FleetFile, name: str) -> HoverThrustLimits:
    """Return the limits of the hover thrust; `FleetError` if the vehicle would land before it warns."""
    battery = fleet.vehicles[name].battery
    try:
        return HoverThrustLimits(battery.warn_at_thrust, battery.land_at_thrust)
    except ValueError:
        raise FleetError(
            f"vehicles.{name}.battery.land_at_thrust: {battery.land_at_thrust:g} must be at least "
            f"warn_at_thrust = {battery.warn_at_thrust:g}"
        ) from None


def succession_of(fleet: FleetFile, name: str) -> Succession:
    """Return how a vehicle reacts to lost leaders, with the order of successors that all vehicles share."""
    promotable = [other for other, vehicle in fleet.vehicles.items() if vehicle.leader_lost.then == "promote"]
    lost = fleet.vehicles[name].leader_lost
    return Succession(
        policy=lost.then,
        after_s=lost.after_s,
        orders={
            leader: tuple(dict.fromkeys((*vehicle.successors, *promotable)))
            for leader, vehicle in fleet.vehicles.items()
        }
        | dict.fromkeys(fleet.subjects, tuple(promotable)),
        promotable=frozenset(promotable),
    )
