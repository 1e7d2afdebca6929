"""Kernels of the Kalman filters (`rcopterx.agents.estimators`)."""

import math

import numpy as np

from rcopterx.native.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    COUNT,
    FLAG,
    MATRIX,
    NUMBER,
    VECTOR,
    Array,
    compiled,
    part,
)
from rcopterx.native.motion import predict_motion


@part
def propagated(transition: Array, covariance: Array, process: Array) -> Array:
    """F P F' + Q, shapes (n, n); entries of F that are zero cost nothing."""
    size = transition.shape[0]
    moved = np.zeros((size, size))
    for row in range(size):
        for inner in range(size):
            factor = transition[row, inner]
            if factor != 0.0:
                for column in range(size):
                    moved[row, column] += factor * covariance[inner, column]
    # Row i of the transpose is the sum of F_ij times column j of F P: P is symmetric, so rows serve as well.
    turned = moved.T.copy()
    result = process.copy()
    for row in range(size):
        for inner in range(size):
            factor = transition[row, inner]
            if factor != 0.0:
                for column in range(size):
                    result[row, column] += factor * turned[inner, column]
    return result


@part
def factorized(matrix: Array) -> bool:
    """Replace the lower triangle of a small matrix by its Cholesky factor; False if it is not definite."""
    for row in range(matrix.shape[0]):
        for column in range(row + 1):
            total = matrix[row, column]
            for inner in range(column):
                total -= matrix[row, inner] * matrix[column, inner]
            if row > column:
                matrix[row, column] = total / matrix[column, column]
            elif total > 0.0:
                matrix[row, row] = math.sqrt(total)
            else:
                return False
    return True


@part
def solve_factorized(factor: Array, right_sides: Array) -> None:
    """Replace right sides, shape (m, n), by the solutions with L L', L the lower triangle of `factor`."""
    size, count = right_sides.shape
    for row in range(size):
        for inner in range(row):
            for column in range(count):
                right_sides[row, column] -= factor[row, inner] * right_sides[inner, column]
        for column in range(count):
            right_sides[row, column] /= factor[row, row]
    for row in range(size - 1, -1, -1):
        for inner in range(row + 1, size):
            for column in range(count):
                right_sides[row, column] -= factor[inner, row] * right_sides[inner, column]
        for column in range(count):
            right_sides[row, column] /= factor[row, row]


@part
def joseph(covariance: Array, gain: Array, spread: Array, observed: Array, variance: Array) -> Array:
    """(I - K H) P (I - K H)' + K V K', which stays symmetric and positive whatever the rounding of the gain.

    Parameters
    ----------
    covariance
        P, shape (n, n).
    gain
        K', shape (m, n).
    spread
        H P, shape (m, n).
    observed
        H, shape (m, n).
    variance
        Diagonal of V, shape (m,).
    """
    count, size = gain.shape
    kept = covariance.copy()
    for row in range(size):
        for number in range(count):
            for column in range(size):
                kept[row, column] -= gain[number, row] * spread[number, column]
    result = kept.copy()
    for row in range(size):
        for number in range(count):
            seen = -variance[number] * gain[number, row]
            for inner in range(size):
                if observed[number, inner] != 0.0:
                    seen += kept[row, inner] * observed[number, inner]
            for column in range(size):
                result[row, column] -= seen * gain[number, column]
    return result


@compiled(VECTOR, MATRIX, ANY_MATRIX, ANY_MATRIX, MATRIX, ANY_VECTOR, NUMBER, ANY_VECTOR, NUMBER, COUNT)
def predict_tilt(
    state: Array,
    covariance: Array,
    transition: Array,
    demand: Array,
    process: Array,
    gain: Array,
    yaw_rad: float,
    stick: Array,
    pole: float,
    moving: int,
) -> None:
    """Move the tilt filter on by a period: x = F x + G stick, P = F P F' + Q.

    The states are the `moving` first ones of the lateral system, servo, wind, and beyond the system trim and
    offset. In the system the servo is a demand; here it is a stick, which heading and gain make a demand.

    Parameters
    ----------
    state, covariance
        Shapes (n + 4,) and (n + 4, n + 4), changed in place.
    transition, demand
        Of the lateral system, shapes (n, n) and (n, 2).
    process
        Q, shape (n + 4, n + 4).
    gain
        Demand per stick, of which the first two are those of pitch and roll.
    yaw_rad
        Heading during the period.
    stick
        What acted, the first two are pitch and roll.
    pole
        Of the servo.
    """
    size = transition.shape[0]
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    turned = np.empty((2, 2))
    turned[0, 0], turned[0, 1] = c * gain[0], -s * gain[1]
    turned[1, 0], turned[1, 1] = s * gain[0], c * gain[1]
    whole = np.eye(size + 4)
    whole[:size, :size] = transition
    pushed = np.empty((moving, 2))
    for row in range(moving):
        for axis in range(2):
            pushed[row, axis] = demand[row, 0] * turned[0, axis] + demand[row, 1] * turned[1, axis]
            whole[row, moving + axis] = (
                transition[row, moving] * turned[0, axis] + transition[row, moving + 1] * turned[1, axis]
            )
            whole[row, size + axis] = pushed[row, axis]
    for axis in range(2):
        whole[moving + axis, size + axis] = 1.0 - pole
    predicted = np.zeros(size + 4)
    for row in range(size + 4):
        for inner in range(size + 4):
            predicted[row] += whole[row, inner] * state[inner]
    for row in range(moving):
        predicted[row] += pushed[row, 0] * stick[0] + pushed[row, 1] * stick[1]
    for axis in range(2):
        predicted[moving + axis] += (1.0 - pole) * stick[axis]
    state[:] = predicted
    covariance[:] = propagated(whole, covariance, process)


@compiled(VECTOR, MATRIX, ANY_VECTOR, ANY_VECTOR, FLAG, COUNT, NUMBER, VECTOR, VECTOR, NUMBER)
def correct_tilt(
    state: Array,
    covariance: Array,
    position_m: Array,
    tilt: Array,
    measured: bool,
    tilted: int,
    yaw_rad: float,
    variances: Array,
    limit: Array,
    gate: float,
) -> tuple[bool, bool]:
    """Take a position and perhaps a tilt into the tilt filter.

    Measured are the first two states, and the states from `tilted` on with the offset (the last two states)
    turned by the heading.

    Parameters
    ----------
    state, covariance
        Shapes (n,) and (n, n), changed in place.
    position_m, tilt
        The first two entries count, those of a tilt only if it is `measured`.
    variances
        Of position and tilt, shape (4,).
    limit
        States stay within plus and minus these, shape (n,).
    gate
        A tilt further than this from the predicted one is left out.

    Returns
    -------
    tuple
        Whether the tilt was taken in, and whether the innovation is definite: if not, state and covariance
        stay what they are.
    """
    size = len(state)
    observed = np.zeros((4, size))
    observed[0, 0] = observed[1, 1] = observed[2, tilted] = observed[3, tilted + 1] = 1.0
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    observed[2, size - 2], observed[2, size - 1] = c, -s
    observed[3, size - 2], observed[3, size - 1] = s, c
    surprise = np.empty(4)
    for axis in range(2):
        surprise[axis] = position_m[axis] - state[axis]
        expected = state[tilted + axis]
        for inner in range(size - 2, size):
            expected += observed[2 + axis, inner] * state[inner]
        surprise[2 + axis] = tilt[axis] - expected
        if measured and abs(surprise[2 + axis]) > gate:
            measured = False
    count = 4 if measured else 2
    spread = np.zeros((count, size))
    for number in range(count):
        for inner in range(size):
            if observed[number, inner] != 0.0:
                for column in range(size):
                    spread[number, column] += observed[number, inner] * covariance[inner, column]
    innovation = np.zeros((count, count))
    for number in range(count):
        for other in range(count):
            for inner in range(size):
                if observed[other, inner] != 0.0:
                    innovation[number, other] += spread[number, inner] * observed[other, inner]
        innovation[number, number] += variances[number]
    if not factorized(innovation):
        return measured, False
    gain = spread.copy()
    solve_factorized(innovation, gain)
    for number in range(count):
        for row in range(size):
            state[row] += gain[number, row] * surprise[number]
    for row in range(size):
        state[row] = min(max(state[row], -limit[row]), limit[row])
    covariance[:] = joseph(covariance, gain, spread, observed, variances)
    return measured, True


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


@compiled(VECTOR, *4 * [ANY_VECTOR], NUMBER, COUNT, *3 * [MATRIX], VECTOR, VECTOR)
def predict_lags(
    vehicle: Array,
    motion: Array,
    actuator: Array,
    sticks: Array,
    disturbance: Array,
    step_s: float,
    steps: int,
    constant: Array,
    covariance: Array,
    process: Array,
    moved: Array,
    held: Array,
) -> None:
    """Move the filter on first-order lags on by a period.

    Parameters
    ----------
    vehicle, motion, actuator, sticks, disturbance, step_s, steps
        See `rcopterx.native.motion.predict_motion`.
    constant
        See `lag_jacobian`.
    covariance, process
        P and Q, shapes (n, n); P is changed in place.
    moved, held
        Set to motion and actuators after the period.
    """
    predict_motion(vehicle, motion, actuator, sticks, disturbance, step_s, steps, moved, held)
    covariance[:] = propagated(lag_jacobian(constant, motion, moved), covariance, process)


@compiled(MATRIX, ANY_VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR)
def correct_lags(
    covariance: Array,
    innovation: Array,
    variance: Array,
    motion: Array,
    actuator: Array,
    disturbance: Array,
    limit: Array,
) -> bool:
    """Take a pose into the filter on first-order lags.

    Parameters
    ----------
    covariance
        P, shape (16, 16).
    innovation, variance
        Measured minus predicted pose, and the variance of what is measured, shape (4,).
    motion, actuator, disturbance
        The state, shapes (8,), (4,) and (4,).
    limit
        Disturbances stay within plus and minus these, shape (4,).

    Returns
    -------
    bool
        Whether the covariance of the innovation is definite. If so, covariance and state have been changed in
        place, else not.
    """
    count = len(innovation)
    observed = np.zeros((count, covariance.shape[0]))
    spread = covariance[:count].copy()
    whole = covariance[:count, :count].copy()
    for number in range(count):
        observed[number, number] = 1.0
        whole[number, number] += variance[number]
    if not factorized(whole):
        return False
    gain = spread.copy()
    solve_factorized(whole, gain)
    change = np.zeros(covariance.shape[0])
    for number in range(count):
        for row in range(covariance.shape[0]):
            change[row] += gain[number, row] * innovation[number]
    for row in range(8):
        motion[row] += change[row]
    for axis in range(4):
        actuator[axis] += change[8 + axis]
        pushed = disturbance[axis] + change[12 + axis]
        disturbance[axis] = min(max(pushed, -limit[axis]), limit[axis])
    covariance[:] = joseph(covariance, gain, spread, observed, variance)
    return True
