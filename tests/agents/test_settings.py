"""Defaults of an agent's settings."""

from support.request_handling import SETTINGS

from rcopterx.agents.tuning.configuration import DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR
from rcopterx.fleet.schema import ControlConfig


def test_agents_and_fleet_files_have_the_same_default_controller_and_estimator() -> None:
    control = ControlConfig()
    assert (control.controller, control.estimator) == (DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR)
    flown = SETTINGS.configuration
    assert (flown.controller, flown.estimator) == (DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR)
