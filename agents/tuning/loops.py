"""Feedback loops of a vehicle in its configuration."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.control.controllers.cascade.controller import CascadeSettings
from rcopterx.control.controllers.cascade.weights import default_weights
from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.margins.axes import lag_loop, tilt_loop
from rcopterx.control.margins.loop import FeedbackLoop
from rcopterx.control.plugins import parse_settings
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_PITCH, U_ROLL, U_THRUST, U_YAW

CONTROLLER: Final = "cascade"
ESTIMATOR: Final = "extended_kalman"  # the pair whose loops are known
HORIZONTAL: Final = "horizontal"  # both horizontal axes of a vehicle with a tilt model, which couples them
HORIZONTAL_AXES: Final = {"x": U_PITCH, "y": U_ROLL}
STEADY_AXES: Final = {"height": U_THRUST, "yaw": U_YAW}


def unknown_loops(configuration: Configuration) -> str | None:
    """Return why the loops of a configuration are not known; None if they are."""
    if (configuration.controller, configuration.estimator) == (CONTROLLER, ESTIMATOR):
        return None
    flown = f"{configuration.controller} with {configuration.estimator}"
    return f"margins are known for {CONTROLLER} with {ESTIMATOR}, not for {flown}"


def loops_of(model: Model, period_s: float, configuration: Configuration) -> Mapping[str, FeedbackLoop]:
    """Loops of a vehicle by axis: `horizontal`, or `x` and `y` without a tilt model, `height` and `yaw`.

    For a configuration without `unknown_loops`, and without integral action. Raises `SettingsError`.
    """
    cascade = parse_settings(CascadeSettings, configuration.controller_settings)
    estimator = parse_settings(ExtendedKalmanSettings, configuration.estimator_settings)
    states, efforts = default_weights(model, period_s)
    states, efforts = cascade.state_weights or states, cascade.input_weights or efforts
    compensate = cascade.disturbance_compensation

    def single(axis: int) -> FeedbackLoop:
        weights = states[axis], states[4 + axis], efforts[axis]
        return lag_loop(model, period_s, axis, weights, estimator, compensate)

    steady = {name: single(axis) for name, axis in STEADY_AXES.items()}
    if model.tilt is None:
        return {name: single(axis) for name, axis in HORIZONTAL_AXES.items()} | steady
    demand = float((np.array(efforts[:2]) / model.b[:2] ** 2).mean())
    weights = 0.5 * (states[0] + states[1]), 0.5 * (states[4] + states[5]), demand
    return {HORIZONTAL: tilt_loop(model, period_s, weights, estimator, compensate)} | steady
