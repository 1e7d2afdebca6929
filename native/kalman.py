"""Kernels of the Kalman filters (`rcopterx.control.estimators`)."""

import math

import numpy as np

from rcopterx.compiling.compiled import (
    ANY_VECTOR,
    BLOCKS,
    COUNT,
    FLAG,
    MATRIX,
    NUMBER,
    VECTOR,
    Array,
    compiled,
)
from rcopterx.native.filtering import corrected, propagate
from rcopterx.native.motion import predict_motion
from rcopterx.native.noise import measure_noise

FAR = 0
TAKEN_IN = 1
INDEFINITE = 2
"""What a filter made of a pose."""
DEVIATIONS = 5.0
"""A departure from the expected pose by so many standard deviations is no surprise."""
TURN_RAD = math.tau
FARTHEST_M = 1e3
MOST_TURNED_RAD = 1e4
"""Poses beyond are not of a laboratory."""


@compiled(MATRIX, BLOCKS, ANY_VECTOR, NUMBER, MATRIX, MATRIX, MATRIX, ANY_VECTOR, NUMBER, COUNT)
def predict_tilt(
    states: Array,
    covariances: Array,
    stick: Array,
    yaw_rad: float,
    transition: Array,
    demand: Array,
    process: Array,
    gain: Array,
    pole: float,
    moving: int,
) -> None:
    """Move tilt filters of a vehicle on by a period: x = F x + G stick, P = F P F' + Q.

    The states are the `moving` first ones of the lateral system, servo, wind, and beyond the system trim and
    offset. In the system the servo is a demand; here it is a stick, which heading and gain make a demand.

    Parameters
    ----------
    states, covariances
        Of each filter, shapes (k, n + 4) and (k, n + 4, n + 4), changed in place.
    stick
        What acted, the first two are pitch and roll.
    yaw_rad
        Heading during the period.
    transition, demand
        Of the lateral system, shapes (n, n) and (n, 2).
    process
        Q, shape (n + 4, n + 4).
    gain
        Demand per stick, of which the first two are those of pitch and roll.
    pole
        Of the servo.
    """
    size = transition.shape[0]
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    turned = np.empty((2, 2))
    turned[0, 0], turned[0, 1] = c * gain[0], -s * gain[1]
    turned[1, 0], turned[1, 1] = s * gain[0], c * gain[1]
    whole = np.zeros((size + 4, size + 4))
    for row in range(size):
        for column in range(size):
            whole[row, column] = transition[row, column]
    for row in range(size, size + 4):
        whole[row, row] = 1.0
    pushed = np.zeros(size + 4)
    for row in range(moving):
        for axis in range(2):
            push = demand[row, 0] * turned[0, axis] + demand[row, 1] * turned[1, axis]
            pushed[row] += push * stick[axis]
            whole[row, moving + axis] = (
                transition[row, moving] * turned[0, axis] + transition[row, moving + 1] * turned[1, axis]
            )
            whole[row, size + axis] = push
    for axis in range(2):
        whole[moving + axis, size + axis] = 1.0 - pole
        pushed[moving + axis] = (1.0 - pole) * stick[axis]
    for number in range(len(states)):
        predicted = pushed.copy()
        for row in range(size + 4):
            for inner in range(size + 4):
                predicted[row] += whole[row, inner] * states[number, inner]
        for row in range(size + 4):
            states[number, row] = predicted[row]
        propagate(whole, covariances[number], process)


@compiled(MATRIX, BLOCKS, ANY_VECTOR, ANY_VECTOR, FLAG, *3 * [NUMBER], COUNT, VECTOR, NUMBER)
def correct_tilt(
    states: Array,
    covariances: Array,
    position_m: Array,
    tilt: Array,
    measured: bool,
    yaw_rad: float,
    position_variance: float,
    tilt_variance: float,
    tilted: int,
    limit: Array,
    gate: float,
) -> tuple[bool, bool]:
    """Take a position into the tilt filters of a vehicle, and perhaps a tilt into the first one.

    Measured are the first two states, and the states from `tilted` on with the offset (the last two states)
    turned by the heading.

    Parameters
    ----------
    states, covariances
        Of each filter, shapes (k, n) and (k, n, n), changed in place.
    position_m, tilt
        The first two entries count, those of a tilt only if it is `measured`.
    position_variance, tilt_variance
        Of what is measured.
    limit
        States stay within plus and minus these, shape (n,).
    gate
        A tilt further than this from the predicted one is left out.

    Returns
    -------
    tuple
        Whether the tilt was taken in, and whether all innovations are definite: where one is not, state and
        covariance of that filter stay what they are.
    """
    size = states.shape[1]
    observed = np.zeros((4, size))
    observed[0, 0] = observed[1, 1] = observed[2, tilted] = observed[3, tilted + 1] = 1.0
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    observed[2, size - 2], observed[2, size - 1] = c, -s
    observed[3, size - 2], observed[3, size - 1] = s, c
    variances, surprise = np.empty(4), np.empty(4)
    variances[0] = variances[1] = position_variance
    variances[2] = variances[3] = tilt_variance
    definite = True
    for number in range(len(states)):
        state = states[number]
        for axis in range(2):
            surprise[axis] = position_m[axis] - state[axis]
        count = 2
        if measured and number == 0:
            for axis in range(2):
                expected = state[tilted + axis]
                for inner in range(size - 2, size):
                    expected += observed[2 + axis, inner] * state[inner]
                surprise[2 + axis] = tilt[axis] - expected
                measured = measured and abs(surprise[2 + axis]) <= gate
            count = 4 if measured else 2
        if corrected(state, covariances[number], observed[:count], surprise, variances):
            for row in range(size):
                state[row] = min(max(state[row], -limit[row]), limit[row])
        else:
            definite = False
    return measured, definite


@compiled(MATRIX, ANY_VECTOR, ANY_VECTOR)
def lag_jacobian(constant: Array, start: Array, end: Array) -> Array:
    """Derivative of the state of the filter on first-order lags after a period by the state before it.

    In the body frame axes are linear chains that the period alone determines; heading, turning of the body
    frame and displacement come in here.

    Parameters
    ----------
    constant
        Of a vehicle at rest that heads along x, shape (n, n); states begin with position, yaw, velocity
        (body) and yaw rate.
    start, end
        Motion state before and after the period, shape (8,).
    """
    size = constant.shape[0]
    jacobian = constant.copy()
    c, s = math.cos(start[3]), math.sin(start[3])
    turned = end[3] - start[3]
    c_turned, s_turned = math.cos(turned), math.sin(turned)
    for column in range(size):
        forward = constant[0, column] if column != 0 else 0.0
        left = constant[1, column] if column != 1 else 0.0
        turn = constant[3, column] if column != 3 else 0.0
        jacobian[0, column] = c * forward - s * left
        jacobian[1, column] = s * forward + c * left
        forward, left = constant[4, column], constant[5, column]
        jacobian[4, column] = c_turned * forward + s_turned * left + end[5] * turn
        jacobian[5, column] = c_turned * left - s_turned * forward - end[4] * turn
    jacobian[0, 0] = jacobian[1, 1] = 1.0
    # Everything else turns with the vehicle, so a turned start turns the displacement.
    jacobian[0, 3] = start[1] - end[1]
    jacobian[1, 3] = end[0] - start[0]
    return jacobian


@compiled(VECTOR, MATRIX, ANY_VECTOR, VECTOR, NUMBER, COUNT, MATRIX, MATRIX)
def predict_lags(
    state: Array,
    covariance: Array,
    sticks: Array,
    vehicle: Array,
    step_s: float,
    steps: int,
    constant: Array,
    process: Array,
) -> float:
    """Move the filter on first-order lags on by a period.

    Parameters
    ----------
    state, covariance
        Motion, actuators, disturbances, and P, shapes (16,) and (16, 16), changed in place.
    sticks, vehicle, step_s, steps
        See `rcopterx.native.motion.predict_motion`.
    constant
        See `lag_jacobian`.
    process
        Q, shape (16, 16).

    Returns
    -------
    float
        Heading in the middle of the period.
    """
    start = state[:8].copy()
    predict_motion(vehicle, start, state[8:12], sticks, state[12:], step_s, steps, state[:8], state[8:12])
    propagate(lag_jacobian(constant, start, state[:8]), covariance, process)
    return float(start[3] + 0.5 * steps * step_s * state[7])


@compiled(VECTOR, MATRIX, ANY_VECTOR, NUMBER, VECTOR, VECTOR, VECTOR, NUMBER, *4 * [VECTOR])
def correct_lags(
    state: Array,
    covariance: Array,
    position_m: Array,
    yaw_rad: float,
    expected_m: Array,
    near: Array,
    noise: Array,
    since_pose_s: float,
    least_noise: Array,
    variance: Array,
    limit: Array,
    pose: Array,
) -> int:
    """Take a pose into the filter on first-order lags if it is near the expected one.

    Parameters
    ----------
    state, covariance
        Motion, actuators, disturbances, and P, shapes (16,) and (16, 16), changed in place.
    position_m, yaw_rad
        Measured, whatever they are.
    expected_m
        Horizontal position that the measured one is compared with, of which the first two entries count.
    near
        Departures from the expected pose up to which one is taken in, besides five standard deviations,
        shape (4,).
    noise, since_pose_s
        Memory of the meter of the noise (`rcopterx.native.noise.observe_noise`), and time since the last
        pose.
    least_noise
        Standard deviations of what is measured, at least, shape (4,).
    variance
        Variances of what is measured, set to what the meter says, shape (4,).
    limit
        Disturbances stay within plus and minus these, shape (4,).
    pose
        Set to the pose, its heading counted with the turns of the expected one, shape (4,).

    Returns
    -------
    int
        `TAKEN_IN`, `FAR` for a pose that is not near, which changes nothing else, or `INDEFINITE` for a
        covariance of the innovation that is not definite, where state and covariance stay what they are.
    """
    for axis in range(3):
        pose[axis] = position_m[axis]
    pose[3] = yaw_rad + TURN_RAD * np.rint((state[3] - yaw_rad) / TURN_RAD)
    # Written so that a comparison with nan refuses.
    if not abs(yaw_rad) <= MOST_TURNED_RAD:
        return FAR
    for axis in range(4):
        if axis < 3 and not abs(pose[axis]) <= FARTHEST_M:
            return FAR
        away = abs(pose[axis] - (expected_m[axis] if axis < 2 else state[axis]))
        if not away <= near[axis] + DEVIATIONS * math.sqrt(covariance[axis, axis] + variance[axis]):
            return FAR
    measure_noise(noise, pose, since_pose_s, least_noise, variance)
    observed, surprise = np.zeros((4, len(state))), np.empty(4)
    for axis in range(4):
        observed[axis, axis] = 1.0
        surprise[axis] = pose[axis] - state[axis]
    if not corrected(state, covariance, observed, surprise, variance):
        return INDEFINITE
    for axis in range(4):
        state[12 + axis] = min(max(state[12 + axis], -limit[axis]), limit[axis])
    return TAKEN_IN
