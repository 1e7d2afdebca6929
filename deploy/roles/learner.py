"""The role of the learner: which vehicles learn, and where their models are kept."""

from typing import Final

from rcopterx.bus.processes import LEARNER
from rcopterx.deploy.hosts.run_directory import log_directory
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.fleet.schema import FleetFile
from rcopterx.fleet.vehicle_models import learning_models
from rcopterx.flights.learner import LearnerSettings, run_learner

KEPT: Final = "learned"  # directory beside the flight logs


def run(fleet: FleetFile, host: str) -> None:
    """Learn the models of the vehicles from their flight."""
    models = learning_models(fleet)
    settings = LearnerSettings(
        bus=bus_address(fleet, host, LEARNER),
        models=models,
        periods_s={name: fleet.vehicles[name].control.period_s for name in models},
        directory=log_directory(fleet) / KEPT / fleet.name,
    )
    run_learner(settings)
