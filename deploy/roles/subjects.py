"""The role of tracked subjects that are no vehicles."""

from dataclasses import replace

import numpy as np

from rcopterx.agents.subjects.process import run_subjects
from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.processes import SUBJECTS
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.schema import FleetFile
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.formation.profile_limits import profile_limits_of
from rcopterx.vehicles.state import three


def run(fleet: FleetFile, host: str) -> None:
    """Publish plans of the subjects, within what every vehicle can follow."""
    margins_m = {name: subject.margin_m for name, subject in fleet.subjects.items()}
    models, leader = {name: model_of(fleet, name) for name in fleet.vehicles}, next(iter(margins_m))
    limits = profile_limits_of(dict.fromkeys(models, (LeaderLink(leader=leader),)), models, leader)
    # Unlike a set point, a person waits for no vehicle: followers use all of their sticks.
    reach = three(np.min([model.reach for model in models.values()], axis=0))
    limits = limits and replace(limits, acceleration=reach)
    period_s = min(vehicle.control.period_s for vehicle in fleet.vehicles.values())
    bus, priority = bus_address(fleet, host, SUBJECTS), Priority.LEADER.of(fleet)
    run_subjects(bus, margins_m, limits, period_s, priority)
