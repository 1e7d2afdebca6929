"""Exact prediction of one vehicle: what the model says it does under inputs that are known.

Estimators move on by it between poses, and the pilot bridges the transport delay with it.
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np

from rcopterx.control.interfaces import NO_TILT, Estimate, TiltEstimate
from rcopterx.control.models.lateral import lateral_system
from rcopterx.control.models.linear import PERIOD_DIGITS
from rcopterx.native.motion import LONGEST_STEP_S, follow_lags, predict_estimate
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_YAW, Array

_MOTION: Final = slice(0, 8)
_ACTUATOR: Final = slice(8, 12)
_TILT_FROM: Final = 12
_SERVO: Final = slice(-4, -2)
_WIND: Final = slice(-2, None)


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
    tilt = NO_TILT if model.tilt is None else estimate.tilt
    cores = len(tilt.core)
    # Kernels write into arrays that are given: to return one takes longer than to make it here.
    after = np.empty(_TILT_FROM + cores + 4)
    predict_estimate(
        estimate.motion,
        estimate.actuator,
        estimate.disturbance,
        tilt.core,
        tilt.servo,
        tilt.wind_m_s2,
        tilt.trim,
        applied_input,
        period_s,
        *_prepared(model, round(period_s, PERIOD_DIGITS)),
        after,
    )
    if cores:
        core = after[_TILT_FROM : _TILT_FROM + cores]
        tilted = TiltEstimate(core, after[_SERVO], after[_WIND], tilt.trim)
    else:
        tilted = NO_TILT
    return Estimate(after[_MOTION], after[_ACTUATOR], estimate.disturbance, tilted)


@lru_cache(maxsize=256)
def _prepared(model: Model, period_s: float) -> tuple[Array, Array, Array, float]:
    """What `predict_estimate` needs to know of a vehicle and a period."""
    if model.tilt is None:
        return parameters(model), np.empty((0, 0)), np.empty((0, 0)), 0.0
    system = lateral_system(model, period_s)
    transition, demand = np.ascontiguousarray(system.transition), np.ascontiguousarray(system.demand)
    return parameters(model), transition, demand, system.servo_pole


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
    steps = max(1, math.ceil(period_s / LONGEST_STEP_S))
    return period_s / steps, steps


@lru_cache(maxsize=64)
def parameters(model: Model) -> Array:
    """What the kernels need to know of a vehicle, shape (`PARAMETERS`,)."""
    rest = model.gravity_m_s2, model.thrust_coupling, model.rate_feedback[U_YAW]
    return np.array((*model.input_gain, *model.direct_damping, *model.lag_s, *rest))
