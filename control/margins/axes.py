"""The feedback loops of a vehicle around its own model, linear: cascade and filter, no bounds, no turning."""

from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np

from rcopterx.control.estimators.process_noise import process_noise
from rcopterx.control.estimators.settings import ExtendedKalmanSettings, noise_of
from rcopterx.control.margins.loop import Dynamics, FeedbackLoop
from rcopterx.control.models.lags import LagDynamics, behind_lag
from rcopterx.control.models.lateral import LateralSystem, lateral_system
from rcopterx.control.models.linear import as_complex, regulator, steady_filter, zero_order_hold
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_YAW

Weights = tuple[float, float, float]  # of position, velocity and input

DEFAULT_FILTER: Final = ExtendedKalmanSettings()
_LEAST_LAG_S: Final = 1e-3


def tilt_loop(
    model: Model,
    period_s: float,
    weights: Weights,
    estimator: ExtendedKalmanSettings = DEFAULT_FILTER,
    compensate: bool = True,
) -> FeedbackLoop:
    """Return the loop of both horizontal axes of a tilt model, complex; its input is the demand [m/s^2]."""
    loop = _filtered_tilt(model, period_s, estimator)
    system = lateral_system(model, period_s)
    known, wind = system.size // 2, system.wind.start // 2
    a, b = loop.filter_step(period_s)
    position, velocity, effort = weights
    states = np.diag((position, velocity, *np.zeros(known - 2)))
    feedback = np.zeros(len(loop.feedback), dtype=complex)
    feedback[:known] = regulator(a[:known, :known], b[:known, None], states, np.array([[effort]]))
    feedback[known] = 1.0  # the trim
    if not compensate:
        feedback[wind] = 0.0
    return replace(loop, feedback=feedback)


@lru_cache(maxsize=16)
def _filtered_tilt(model: Model, period_s: float, estimator: ExtendedKalmanSettings) -> FeedbackLoop:
    """Plant and filter of `tilt_loop`, without feedback."""
    assert model.tilt is not None
    tilt, gain = model.tilt, float(model.b[:2].mean())
    system = lateral_system(model, period_s)
    servo, wind, trim = system.servo.start // 2, system.wind.start // 2, system.size // 2
    offset = trim + 1
    a = np.zeros((offset + 1, offset + 1), dtype=complex)
    a[:trim, :trim] = as_complex(system.continuous)
    a[servo, trim] = 1.0 / tilt.servo_lag_s
    b = np.zeros(offset + 1, dtype=complex)
    b[servo] = 1.0 / tilt.servo_lag_s
    measured = np.zeros((2, offset + 1), dtype=complex)
    measured[0, 0] = measured[1, system.tilt.start // 2] = measured[1, offset] = 1.0
    measured[0, system.tilt.start // 2] = model.lever_arm_m
    per_stick = np.ones(offset + 1)
    per_stick[[servo, trim]] = gain
    process = as_complex(process_noise(model, estimator, period_s)) * np.outer(per_stick, per_stick)
    noise = np.diag(np.square((estimator.position_noise_m, estimator.tilt_noise)))
    if not estimator.measured_tilt:
        # The offset of the body frame is unknown then, and does not matter.
        a, b, process = a[:offset, :offset], b[:offset], process[:offset, :offset]
        measured, noise = measured[:1, :offset], noise[:1, :1]

    dampings = model.uncertainty.tilt_damping or (tilt.damping_ratio,)
    nearest = min(max(tilt.damping_ratio, dampings[0]), dampings[-1])

    @lru_cache(maxsize=64)
    def plant_step(frequency: float, damping: float | None, time_s: float) -> Dynamics:
        ratio = nearest if damping is None else damping
        true = replace(tilt, frequency_rad_s=frequency * tilt.frequency_rad_s, damping_ratio=ratio)
        dynamics = as_complex(LateralSystem(replace(model, tilt=true), period_s).continuous)
        return zero_order_hold(dynamics[:wind, :wind], b[:wind], time_s)

    @lru_cache(maxsize=8)
    def filter_step(time_s: float) -> Dynamics:
        return zero_order_hold(a, b, time_s)

    return FeedbackLoop(
        plant_step=plant_step,
        measured=measured[:, :wind],
        filter_step=filter_step,
        filter_measured=measured,
        filter_gain=steady_filter(filter_step(period_s)[0], measured, process, noise)[1],
        feedback=np.zeros(len(b)),
        period_s=period_s,
        delay_s=model.delay_s,
        rule=model.uncertainty.axes[0],
        dampings=dampings,
        measured_tilt=estimator.measured_tilt,
    )


def lag_loop(
    model: Model,
    period_s: float,
    axis: int,
    weights: Weights,
    estimator: ExtendedKalmanSettings = DEFAULT_FILTER,
    compensate: bool = True,
) -> FeedbackLoop:
    """Return the loop of one axis (x, y, height, yaw) behind a first-order lag; its input is the stick."""
    position, velocity, effort = weights
    a, b = LagDynamics.of(model, period_s, slice(axis, axis + 1)).matrices()
    feedback = np.zeros(4)
    feedback[:3] = regulator(a, b, np.diag((position, velocity, 0.0)), np.array([[effort]]))
    if compensate:
        feedback[3] = (1.0 + feedback[2]) / model.input_gain[axis]
    return replace(_filtered_lag(model, period_s, axis, estimator), feedback=feedback)


@lru_cache(maxsize=64)
def _filtered_lag(
    model: Model, period_s: float, axis: int, estimator: ExtendedKalmanSettings
) -> FeedbackLoop:
    """Plant and filter of `lag_loop`, without feedback: position, velocity, actuator, disturbance."""

    @lru_cache(maxsize=64)
    def step(frequency: float, time_s: float) -> Dynamics:
        lag_s = max(model.lag_s[axis] / frequency, _LEAST_LAG_S)
        return zero_order_hold(*behind_lag(model, axis, lag_s, disturbances=1), time_s)

    def plant_step(frequency: float, _: float | None, time_s: float) -> Dynamics:
        a, b = step(frequency, time_s)
        return a[:3, :3], b[:3]

    expected = noise_of(model, estimator)
    drifts = expected.velocity_noise, expected.actuator_noise, estimator.disturbance_noise
    densities = [0.0, *(drift[axis] for drift in drifts)]
    noise = estimator.yaw_noise_rad if axis == U_YAW else estimator.position_noise_m
    measured = np.array([[1.0, 0.0, 0.0, 0.0]])
    process = period_s * np.diag(np.square(densities))
    return FeedbackLoop(
        plant_step=plant_step,
        measured=measured[:, :3],
        filter_step=lambda time_s: step(1.0, time_s),
        filter_measured=measured,
        filter_gain=steady_filter(step(1.0, period_s)[0], measured, process, np.array([[noise**2]]))[1],
        feedback=np.zeros(4),
        period_s=period_s,
        delay_s=model.delay_s,
        rule=model.uncertainty.axes[axis],
    )
