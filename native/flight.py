"""Kernels of what nearly every frame of a flying vehicle with a tilt model needs, in one call each.

They put kernels of the Kalman filters together (`rcopterx.control.estimators.tilt_kalman`); whatever is not
usual is left to who asked.
"""

import math

import numpy as np

from rcopterx.compiling.compiled import (
    ANY_VECTOR,
    BLOCKS,
    COUNT,
    MATRIX,
    NUMBER,
    VECTOR,
    Array,
    compiled,
)
from rcopterx.native.kalman import TAKEN_IN, correct_lags, correct_tilt, predict_lags, predict_tilt
from rcopterx.native.motion import THRUST
from rcopterx.native.noise import NOISE, TRUSTED, judge_tilt

UNREADABLE_TILT = 3
AT_LIMIT = 4
TRUST_CHANGED = 5
TILT_LEFT_OUT = 6
INDEFINITE_TILT = 7
"""What came of a pose besides what `rcopterx.native.kalman` knows: nothing has changed, as its tilt is not
finite; the filter on lags has taken it in, and the upward disturbance is at its limit; that, and whether the
tilt is trusted has changed; all has taken it in but for its tilt; the covariance of a tilt filter is not
definite."""
TOLD = 16
"""Motion, actuators and disturbances come first in what is told; the state of the tilt filter follows."""


@compiled(
    VECTOR, MATRIX, MATRIX, BLOCKS, ANY_VECTOR, VECTOR, NUMBER, COUNT,
    *5 * [MATRIX], ANY_VECTOR, NUMBER, COUNT,
)  # fmt: skip
def predict_filters(
    state: Array,
    covariance: Array,
    tilt_states: Array,
    tilt_covariances: Array,
    sticks: Array,
    vehicle: Array,
    step_s: float,
    steps: int,
    constant: Array,
    process: Array,
    transition: Array,
    demand: Array,
    tilt_process: Array,
    gain: Array,
    pole: float,
    moving: int,
) -> None:
    """Move the filter on lags and the tilt filters on by a period.

    Parameters
    ----------
    state, covariance, sticks, vehicle, step_s, steps, constant, process
        See `rcopterx.native.kalman.predict_lags`.
    tilt_states, tilt_covariances, transition, demand, tilt_process, gain, pole, moving
        See `rcopterx.native.kalman.predict_tilt`.
    """
    middle_rad = predict_lags(state, covariance, sticks, vehicle, step_s, steps, constant, process)
    predict_tilt(
        tilt_states,
        tilt_covariances,
        sticks,
        middle_rad,
        transition,
        demand,
        tilt_process,
        gain,
        pole,
        moving,
    )


@compiled(VECTOR, VECTOR, VECTOR)
def tell(state: Array, tilt_state: Array, told: Array) -> None:
    """Tell what filters know.

    Parameters
    ----------
    state
        Of the filter on lags, shape (16,).
    tilt_state
        Of the tilt filter that is believed, shape (n,).
    told
        Set to motion with the horizontal position and velocity of the tilt filter, actuators, disturbances
        and the state of the tilt filter, shape (`TOLD` + n,).
    """
    for place in range(16):
        told[place] = state[place]
    for place in range(len(tilt_state)):
        told[TOLD + place] = tilt_state[place]
    c, s = math.cos(state[3]), math.sin(state[3])
    told[0], told[1], vx, vy = tilt_state[0], tilt_state[1], tilt_state[2], tilt_state[3]
    told[4], told[5] = c * vx + s * vy, c * vy - s * vx


@compiled(VECTOR, VECTOR, VECTOR, VECTOR)
def expect_noise(pose_variance: Array, trust: Array, least: Array, variances: Array) -> None:
    """Set variances of a measured position and a measured tilt, shape (2,).

    Parameters
    ----------
    pose_variance
        Of position and heading, as measured, shape (4,).
    trust
        See `rcopterx.native.noise.TRUST`.
    least
        Standard deviations of position and tilt, at least, shape (2,).
    """
    variances[0] = max(math.sqrt(pose_variance[0]), least[0]) ** 2
    variances[1] = max(trust[NOISE], least[1]) ** 2


@compiled(
    VECTOR, MATRIX, MATRIX, BLOCKS, COUNT, ANY_VECTOR, NUMBER, ANY_VECTOR, VECTOR, VECTOR, NUMBER,
    *8 * [VECTOR], COUNT, VECTOR, NUMBER, VECTOR,
)  # fmt: skip
def correct_filters(
    state: Array,
    covariance: Array,
    tilt_states: Array,
    tilt_covariances: Array,
    believed: int,
    position_m: Array,
    yaw_rad: float,
    tilt: Array,
    near: Array,
    noise: Array,
    since_pose_s: float,
    least_noise: Array,
    variance: Array,
    limit: Array,
    pose: Array,
    trust: Array,
    tilt_noise: Array,
    least: Array,
    variances: Array,
    tilted: int,
    tilt_limit: Array,
    gate: float,
    told: Array,
) -> int:
    """Take a pose into the filter on lags and the tilt filters, if it is near the expected one.

    Parameters
    ----------
    state, covariance, position_m, yaw_rad, near, noise, since_pose_s, least_noise, variance, limit, pose
        See `rcopterx.native.kalman.correct_lags`.
    tilt_states, tilt_covariances, tilted, tilt_limit, gate
        See `rcopterx.native.kalman.correct_tilt`.
    believed
        Tilt filter that tells the horizontal position.
    tilt
        As measured, shape (2,); empty where it is not.
    trust, tilt_noise
        See `rcopterx.native.noise.judge_tilt`; what positions let expect is said by the last tilt filter.
    least, variances
        See `expect_noise`.
    told
        See `tell`; set once all has been taken in.

    Returns
    -------
    int
        `TAKEN_IN`, or what was not usual and where it ended.
    """
    measured = len(tilt) > 0
    if measured and not (math.isfinite(tilt[0]) and math.isfinite(tilt[1])):
        return UNREADABLE_TILT
    outcome = correct_lags(
        state,
        covariance,
        position_m,
        yaw_rad,
        tilt_states[believed],
        near,
        noise,
        since_pose_s,
        least_noise,
        variance,
        limit,
        pose,
    )
    if outcome != TAKEN_IN:
        return outcome
    if state[12 + THRUST] >= limit[THRUST]:
        return AT_LIMIT
    if measured:
        expected = np.empty(2)
        for axis in range(2):
            expected[axis] = tilt_states[len(tilt_states) - 1, tilted + axis]
        if judge_tilt(trust, tilt_noise, tilt, expected, pose[3], since_pose_s):
            return TRUST_CHANGED
    expect_noise(variance, trust, least, variances)
    measured = measured and trust[TRUSTED] > 0.0
    taken_in, definite = correct_tilt(
        tilt_states,
        tilt_covariances,
        pose,
        tilt,
        measured,
        pose[3],
        variances[0],
        variances[1],
        tilted,
        tilt_limit,
        gate,
    )
    if not definite:
        return INDEFINITE_TILT
    tell(state, tilt_states[believed], told)
    return TAKEN_IN if taken_in or not measured else TILT_LEFT_OUT
