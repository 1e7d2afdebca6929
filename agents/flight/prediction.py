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
from rcopterx.vehicles.state import INPUT_SIZE, MOTION_SIZE, U_YAW, Array

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
    # Kernels write into arrays that are given: to return one takes longer than to make it here.
    motion, actuator = np.empty(MOTION_SIZE), np.empty(INPUT_SIZE)
    predict_motion(
        parameters(model),
        estimate.motion,
        estimate.actuator,
        applied_input,
        estimate.disturbance,
        *split(period_s),
        motion,
        actuator,
    )
    tilt = estimate.tilt
    if tilt is not None and model.tilt is not None:
        tilt = _predict_tilt(model, estimate.motion, tilt, motion, applied_input, period_s)
    else:
        tilt = None
    return Estimate(motion, actuator, estimate.disturbance, tilt)


def _predict_tilt(
    model: Model, start: Array, tilt: TiltEstimate, end: Array, applied_input: Array, period_s: float
) -> TiltEstimate:
    """Tilt after a period; the horizontal motion is set in `end`, whose heading and height are kept."""
    system = lateral_system(model, period_s)
    cores = len(tilt.core)
    predicted = np.empty(cores + 4)
    predict_with_tilt(
        start,
        tilt.core,
        tilt.servo,
        tilt.wind_m_s2,
        tilt.trim,
        applied_input,
        parameters(model),
        system.transition,
        system.demand,
        system.servo_pole,
        end,
        predicted,
    )
    servo, wind = predicted[cores : cores + 2], predicted[cores + 2 :]
    return TiltEstimate(predicted[:cores], servo, wind, tilt.trim)


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
