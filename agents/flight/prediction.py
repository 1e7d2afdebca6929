"""Exact prediction of one vehicle: what the model says it does under inputs that are known.

Estimators move on by it between poses, and the pilot bridges the transport delay with it.
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np

from rcopterx.agents.flight.lateral import lateral_system
from rcopterx.agents.interfaces import Estimate, TiltEstimate
from rcopterx.native.motion import follow_lags, predict_motion, predict_with_tilt
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_YAW, Array

_LONGEST_STEP_S: Final = 0.0201
"""Beyond one 50 Hz period Runge-Kutta steps are split, which keeps positions exact to micrometres."""


def predict(model: Model, estimate: Estimate, applied_input: Array, period_s: float) -> Estimate:
    """Predict a vehicle through a period during which one input acts.

    Actuators follow their exact exponential response, that of yaw to what gyro and thrust make of its stick
    in the middle of a step. The motion (1) is integrated by classical Runge-Kutta steps of at most 20 ms, and
    the estimated disturbance is taken to last. Where the tilt is known, the horizontal motion follows the
    tilt model instead, and the wind fades.

    Parameters
    ----------
    model
        The vehicle.
    estimate
        What is known at the start of the period.
    applied_input
        Input at the actuators (the transport delay already passed), shape (4,).
    period_s
        Length of the period.

    Returns
    -------
    Estimate
        At the end of the period; the disturbance is the given one.
    """
    motion, actuator = predict_motion(
        parameters(model),
        estimate.motion,
        estimate.actuator,
        applied_input,
        estimate.disturbance,
        *split(period_s),
    )
    predicted = Estimate(motion, actuator, estimate.disturbance)
    if estimate.tilt is None or model.tilt is None:
        return predicted
    return _with_tilt(model, estimate, estimate.tilt, predicted, applied_input, period_s)


def _with_tilt(
    model: Model, start: Estimate, tilt: TiltEstimate, end: Estimate, applied_input: Array, period_s: float
) -> Estimate:
    """The horizontal part of a prediction by the tilt model; heading and height are those of `end`."""
    system = lateral_system(model, period_s)
    motion, core, servo, wind = predict_with_tilt(
        start.motion,
        end.motion,
        tilt.core,
        tilt.servo,
        tilt.wind_m_s2,
        tilt.trim,
        applied_input,
        parameters(model)[:2],
        system.transition,
        system.demand,
        system.servo_pole,
    )
    return Estimate(motion, end.actuator, end.disturbance, TiltEstimate(core, servo, wind, tilt.trim))


def actuator_response(
    model: Model, actuator: Array, applied_input: Array, yaw_rate_rad_s: float, period_s: float
) -> Array:
    """Exact response of the actuator lags at a constant yaw rate.

    Parameters
    ----------
    model
        The vehicle.
    actuator
        Actuator states at the start of the period, shape (4,).
    applied_input
        Input that acts during the period, shape (4,).
    yaw_rate_rad_s
        What a gyro measures.
    period_s
        Length of the period.

    Returns
    -------
    Array
        Actuator states at its end, shape (4,).
    """
    return follow_lags(parameters(model), actuator, applied_input, yaw_rate_rad_s, period_s)


def split(period_s: float) -> tuple[float, int]:
    """Steps of the integration of a period: how long, and how many."""
    steps = max(1, math.ceil(period_s / _LONGEST_STEP_S))
    return period_s / steps, steps


@lru_cache(maxsize=64)
def parameters(model: Model) -> Array:
    """What the kernels need to know of a vehicle, shape (`PARAMETERS`,)."""
    rest = model.gravity_m_s2, model.thrust_coupling, model.rate_feedback[U_YAW]
    return np.array((*model.input_gain, *model.direct_damping, *model.lag_s, *rest))
