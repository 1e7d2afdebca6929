"""The feedback loops of a vehicle that flies with `cascade` and `extended_kalman`."""

from collections.abc import Mapping

import numpy as np

from rcopterx.control.controllers.cascade.controller import CascadeSettings
from rcopterx.control.controllers.cascade.weights import default_weights
from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.margins.axes import lag_loop, tilt_loop
from rcopterx.control.margins.loop import FeedbackLoop
from rcopterx.control.plugins import parse_settings
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_PITCH, U_ROLL, U_THRUST, U_YAW


def loops_of(
    model: Model, period_s: float, controller: Mapping[str, object], estimator: Mapping[str, object]
) -> dict[str, FeedbackLoop]:
    """Return the loops with settings of both, by axis, without integral action; raise `SettingsError`.

    `horizontal` for both axes of a tilt model, which couples them, else `x` and `y`; `height` and `yaw`.
    """
    cascade = parse_settings(CascadeSettings, controller)
    kalman = parse_settings(ExtendedKalmanSettings, estimator)
    states, efforts = default_weights(model, period_s)
    states, efforts = cascade.state_weights or states, cascade.input_weights or efforts
    compensate = cascade.disturbance_compensation
    axes = {"x": U_PITCH, "y": U_ROLL} if model.tilt is None else {}
    loops = {}
    if model.tilt is not None:
        demand = float((np.array(efforts[:2]) / model.b[:2] ** 2).mean())
        weights = 0.5 * (states[0] + states[1]), 0.5 * (states[4] + states[5]), demand
        loops["horizontal"] = tilt_loop(model, period_s, weights, kalman, compensate)
    for name, axis in (axes | {"height": U_THRUST, "yaw": U_YAW}).items():
        weights = states[axis], states[4 + axis], efforts[axis]
        loops[name] = lag_loop(model, period_s, axis, weights, kalman, compensate)
    return loops
