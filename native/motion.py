"""Kernels of the equations of motion (`rcopterx.control.models.prediction`)."""

import math

import numpy as np

from rcopterx.compiling.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    COUNT,
    ESTIMATE,
    MATRIX,
    NUMBER,
    VECTOR,
    Array,
    compiled,
    part,
)

GAIN = 0
DAMPING = 4
LAG = 8
GRAVITY = 12
COUPLING = 13
GYRO = 14
PARAMETERS = 15
"""Where the parameters of a vehicle are in an array: four input gains, four dampings that act at once, four
lags, gravity, yaw stick per thrust that the rotors have not followed, and per yaw rate."""
THRUST = 2
TURN = 3
LONGEST_STEP_S = 0.0201
"""Beyond one 50 Hz period Runge-Kutta steps are split, which keeps positions exact to micrometres."""


@part
def after_lag(vehicle: Array, actuator: Array, target: Array, time_s: float) -> Array:
    """Actuators some time after they began to follow a target, shapes (4,)."""
    after = target.copy()
    for axis in range(4):
        lag_s = vehicle[LAG + axis]
        if lag_s > 0.0:
            after[axis] += (actuator[axis] - target[axis]) * math.exp(-time_s / lag_s)
    return after


@part
def followed(
    vehicle: Array, yaw_rate: float, actuator: Array, sticks: Array, push_yaw: float, time_s: float
) -> Array:
    """Sticks with what gyro and thrust make of that of yaw in the middle of a time, shape (4,)."""
    half_s = 0.5 * time_s
    middle_rate = yaw_rate + half_s * (vehicle[GAIN + TURN] * actuator[TURN] + push_yaw)
    ahead = sticks[THRUST] - after_lag(vehicle, actuator, sticks, half_s)[THRUST]
    result = sticks.copy()
    result[TURN] += vehicle[COUPLING] * ahead - vehicle[GYRO] * middle_rate
    return result


@part
def derivative(vehicle: Array, motion: Array, actuator: Array, disturbance: Array) -> Array:
    """Equation (1): rates of the motion state, shape (8,)."""
    c, s = math.cos(motion[3]), math.sin(motion[3])
    xd, yd, zd, yaw_rate = motion[4], motion[5], motion[6], motion[7]
    rates = np.empty(8)
    rates[0] = c * xd - s * yd
    rates[1] = s * xd + c * yd
    rates[2] = zd
    rates[3] = yaw_rate
    for axis in range(4):
        rates[4 + axis] = (
            vehicle[GAIN + axis] * actuator[axis]
            + disturbance[axis]
            + vehicle[DAMPING + axis] * motion[4 + axis]
        )
    rates[4] += yaw_rate * yd
    rates[5] -= yaw_rate * xd
    rates[6] -= vehicle[GRAVITY]
    return rates


@part
def moved_on(motion: Array, rates: Array, time_s: float) -> Array:
    """Motion state after some time at these rates, shape (8,)."""
    # Expressions and slices of whole arrays take numba seconds to compile.
    result = motion.copy()
    for number in range(8):
        result[number] += time_s * rates[number]
    return result


@compiled(VECTOR, *4 * [ANY_VECTOR], NUMBER, COUNT, VECTOR, VECTOR)
def predict_motion(
    vehicle: Array,
    motion: Array,
    actuator: Array,
    sticks: Array,
    disturbance: Array,
    step_s: float,
    steps: int,
    moved: Array,
    held: Array,
) -> None:
    """Motion and actuators after some steps of classical Runge-Kutta.

    Parameters
    ----------
    vehicle
        Parameters, shape (`PARAMETERS`,).
    motion, actuator, sticks, disturbance
        At the start; shapes (8,), (4,), (4,), (4,).
    step_s, steps
        Length of a step, and how many.
    moved, held
        Set to motion and actuators afterwards.
    """
    at, holding, given, pushed = motion.copy(), actuator.copy(), sticks.copy(), disturbance.copy()
    for _ in range(steps):
        half_s = 0.5 * step_s
        now = after_lag(vehicle, holding, followed(vehicle, at[7], holding, given, pushed[3], 0.0), 0.0)
        target = followed(vehicle, at[7], holding, given, pushed[3], half_s)
        middle = after_lag(vehicle, holding, target, half_s)
        end = after_lag(vehicle, holding, followed(vehicle, at[7], holding, given, pushed[3], step_s), step_s)
        f1 = derivative(vehicle, at, now, pushed)
        f2 = derivative(vehicle, moved_on(at, f1, half_s), middle, pushed)
        f3 = derivative(vehicle, moved_on(at, f2, half_s), middle, pushed)
        f4 = derivative(vehicle, moved_on(at, f3, step_s), end, pushed)
        for number in range(8):
            f1[number] = f1[number] + 2 * f2[number] + 2 * f3[number] + f4[number]
        at = moved_on(at, f1, step_s / 6)
        holding = end
    for number in range(8):
        moved[number] = at[number]
    for axis in range(4):
        held[axis] = holding[axis]


@compiled(VECTOR, ANY_VECTOR, ANY_VECTOR, NUMBER, NUMBER)
def follow_lags(vehicle: Array, actuator: Array, sticks: Array, yaw_rate: float, period_s: float) -> Array:
    """Actuators after a period at a constant yaw rate without disturbance, shape (4,)."""
    steady = np.zeros(4)
    steady[THRUST] = actuator[THRUST]
    target = followed(vehicle, yaw_rate, steady, sticks.copy(), 0.0, period_s)
    return after_lag(vehicle, actuator.copy(), target, period_s)


@compiled(*7 * [ANY_VECTOR], ANY_MATRIX, ANY_MATRIX, NUMBER, VECTOR, VECTOR)
def predict_with_tilt(
    motion: Array,
    core: Array,
    servo: Array,
    wind: Array,
    trim: Array,
    sticks: Array,
    gain: Array,
    transition: Array,
    demand: Array,
    pole: float,
    moved: Array,
    tilted: Array,
) -> None:
    """Horizontal motion of a vehicle with a tilt model after a period, x = F x + G e.

    Parameters
    ----------
    motion
        Motion state before the period, shape (8,).
    core, servo, wind, trim
        Of the tilt model, shapes (k,), (2,), (2,), (2,).
    sticks
        What acts, its first two are pitch and roll.
    gain
        Demand per stick, of which the first two are those of pitch and roll.
    transition, demand
        F and G, shapes (n, n) and (n, 2), n = k + 8.
    pole
        Of the servo.
    moved
        Motion state after the period, whose height and heading are kept and whose horizontal motion is set,
        shape (8,).
    tilted
        Set to core, servo and wind after the period, shape (k + 4,).
    """
    cores = len(core)
    size = cores + 8
    state = np.empty(size)
    yaw, end = motion[3], moved[3]
    c, s = math.cos(yaw), math.sin(yaw)
    state[0], state[1] = motion[0], motion[1]
    state[2] = c * motion[4] - s * motion[5]
    state[3] = s * motion[4] + c * motion[5]
    for place in range(cores):
        state[4 + place] = core[place]
    middle = 0.5 * (yaw + end)
    c, s = math.cos(middle), math.sin(middle)
    stick_x, stick_y = sticks[0] + trim[0], sticks[1] + trim[1]
    state[4 + cores] = c * gain[0] * servo[0] - s * gain[1] * servo[1]
    state[5 + cores] = s * gain[0] * servo[0] + c * gain[1] * servo[1]
    state[6 + cores], state[7 + cores] = wind[0], wind[1]
    demand_x = c * gain[0] * stick_x - s * gain[1] * stick_y
    demand_y = s * gain[0] * stick_x + c * gain[1] * stick_y
    after = np.empty(size)
    for row in range(size):
        total = demand[row, 0] * demand_x + demand[row, 1] * demand_y
        for column in range(size):
            total += transition[row, column] * state[column]
        after[row] = total
    moved[0], moved[1] = after[0], after[1]
    c, s = math.cos(end), math.sin(end)
    moved[4] = c * after[2] + s * after[3]
    moved[5] = c * after[3] - s * after[2]
    for place in range(cores):
        tilted[place] = after[4 + place]
    tilted[cores] = stick_x + pole * (servo[0] - stick_x)
    tilted[cores + 1] = stick_y + pole * (servo[1] - stick_y)
    tilted[cores + 2], tilted[cores + 3] = after[6 + cores], after[7 + cores]


@compiled(*ESTIMATE, ANY_VECTOR, NUMBER, VECTOR, MATRIX, MATRIX, NUMBER, VECTOR)
def predict_estimate(
    motion: Array,
    actuator: Array,
    disturbance: Array,
    core: Array,
    servo: Array,
    wind: Array,
    trim: Array,
    sticks: Array,
    period_s: float,
    vehicle: Array,
    transition: Array,
    demand: Array,
    pole: float,
    after: Array,
) -> None:
    """All that is known of a vehicle after a period: `predict_motion` and, with a tilt, `predict_with_tilt`.

    Parameters
    ----------
    motion, actuator, disturbance
        At the start; shapes (8,), (4,), (4,).
    core, servo, wind, trim
        Of the tilt model; empty for none.
    sticks
        What acts, shape (4,).
    period_s
        Split into steps of at most `LONGEST_STEP_S`.
    vehicle
        Parameters, shape (`PARAMETERS`,).
    transition, demand, pole
        See `predict_with_tilt`.
    after
        Set to motion, actuators, core, servo and wind at the end, shape (12,) or (16 + k,).
    """
    steps = max(1, math.ceil(period_s / LONGEST_STEP_S))
    moved = after[:8]
    predict_motion(
        vehicle, motion, actuator, sticks, disturbance, period_s / steps, steps, moved, after[8:12]
    )
    if len(servo) > 0:
        tilted = after[12:]
        predict_with_tilt(
            motion, core, servo, wind, trim, sticks, vehicle, transition, demand, pole, moved, tilted
        )
