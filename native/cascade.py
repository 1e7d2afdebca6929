"""Kernels that put the cascade's problems together (`rcopterx.control.controllers.cascade`).

Bounds have shape (2, 6): the lower and the upper ones of position, velocity and input of two axes.
"""

import math
from typing import Final

import numpy as np

from rcopterx.compiling.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    BLOCKS,
    FLAG,
    MATRIX,
    NUMBER,
    TARGET,
    VECTOR,
    Array,
    compiled,
    part,
)
from rcopterx.native.bounds import cut_reference

STEADY: Final = (
    MATRIX, MATRIX, ANY_VECTOR, ANY_VECTOR, NUMBER, NUMBER, VECTOR, NUMBER, FLAG, VECTOR, VECTOR, ANY_VECTOR,
    FLAG, ANY_VECTOR,
)  # fmt: skip
"""Types of what `steady_problem` knows of a vehicle, from `bounds` to `gain`."""
NARROWEST: Final = 0.01
"""Range of a command that is still worth planning with."""


@part
def cut_to_bounds(rows: Array, bounds: Array, balance: Array, share: Array, low: Array, high: Array) -> None:
    """Bounds of two axes' rows whose inputs balance what pushes; inputs among the rows are cut to them.

    Parameters
    ----------
    rows
        Position, velocity, input, shape (N, 6), changed in place.
    bounds
        Those of the inputs without balance.
    balance
        Shape (2,).
    share
        Least and most of the range to plan with, shape (2, 2); where the balance leaves no more than
        `NARROWEST` of it, the whole range counts.
    low, high
        Set to the bounds, shape (1, 6).
    """
    # Number by number here and below: numba takes seconds to compile assignments of slices.
    for at in range(bounds.shape[1]):
        low[0, at], high[0, at] = bounds[0, at], bounds[1, at]
    for axis in range(2):
        at = 4 + axis
        below, above = bounds[0, at] + balance[axis], bounds[1, at] + balance[axis]
        if min(above, share[1, axis]) - max(below, share[0, axis]) > NARROWEST:
            below, above = max(below, share[0, axis]), min(above, share[1, axis])
        low[0, at], high[0, at] = below, above
        for stage in range(len(rows)):
            rows[stage, at] = min(max(rows[stage, at], below), above)


@part
def write_turn(turn: Array, stage: int, cosine: float, sine: float) -> None:
    """Write R(psi) of a heading into its stage, of shape (s, 2, 2)."""
    turn[stage, 0, 0] = turn[stage, 1, 1] = cosine
    turn[stage, 1, 0] = sine
    turn[stage, 0, 1] = -sine


@part
def chain_rows(
    position: Array,
    velocity: Array,
    after: Array,
    carried: Array,
    push: Array,
    pole: Array,
    feedback: Array,
    lagged: bool,
    rows: Array,
    terminal: Array,
) -> None:
    """Reference of a chain with the inputs that fly it.

    The actuator makes the velocity `after` a stage of the `carried` one, and the input makes the next
    actuator of the present one.

    Parameters
    ----------
    position, velocity, after, carried
        Shape (N, m).
    push, pole, feedback
        Velocity per actuator and stage, pole of the lag, and stick per velocity, shape (m,).
    lagged
        Whether there is a lag.
    rows
        Set to position, velocity and input, shape (N, 3 m).
    terminal
        Set to position, velocity[, actuator] at the end, shape (levels m,).
    """
    stages, axes = position.shape
    for axis in range(axes):
        rows[stages - 1, 2 * axes + axis] = 0.0
        actuator = 0.0
        for stage in range(stages):
            rows[stage, axis], rows[stage, axes + axis] = position[stage, axis], velocity[stage, axis]
            before = actuator
            actuator = (after[stage, axis] - carried[stage, axis]) / push[axis]
            if lagged and stage > 0:
                stick = (actuator - pole[axis] * before) / (1.0 - pole[axis])
                rows[stage - 1, 2 * axes + axis] = stick + feedback[axis] * velocity[stage - 1, axis]
            elif not lagged and stage < stages - 1:
                rows[stage, 2 * axes + axis] = actuator
        terminal[axis], terminal[axes + axis] = position[stages - 1, axis], velocity[stages - 1, axis]
        if lagged:
            terminal[2 * axes + axis] = actuator


@part
def chain_state(motion: Array, actuator: Array, axis: int, first: Array) -> None:
    """Set position, velocity[, actuator] of an axis and the next one, shape (levels, 2)."""
    for beside in range(2):
        first[0, beside], first[1, beside] = motion[axis + beside], motion[4 + axis + beside]
        if len(first) > 2:
            first[2, beside] = actuator[axis + beside]


@part
def cut_to_balance(
    rows: Array, bounds: Array, load: Array, gain: Array, share: Array, low: Array, high: Array
) -> None:
    """As `cut_to_bounds`, where inputs of a gain balance a load, shape (2,)."""
    balance = np.empty(2)
    for axis in range(2):
        balance[axis] = load[axis] / gain[axis]
    cut_to_bounds(rows, bounds, balance, share, low, high)


@part
def steady_rows(
    samples: Array,
    decay: Array,
    period_s: float,
    feed_forward: bool,
    push: Array,
    pole: Array,
    feedback: Array,
    lagged: bool,
    rows: Array,
    terminal: Array,
) -> None:
    """Reference of the vertical and of yaw, whose frame is the inertial one.

    Parameters
    ----------
    samples
        Reference: columns 2 to 3 position, 6 to 7 velocity, 10 to 11 acceleration, shape (N, 12).
    decay
        F, shape (2,).
    feed_forward
        Whether inputs are those that fly the reference, or those that carry its velocities on.
    push, pole, feedback, lagged, rows, terminal
        As in `chain_rows`.
    """
    stages = len(samples)
    carried, after = np.empty((stages, 2)), np.empty((stages, 2))
    for stage in range(stages):
        for axis in range(2):
            wanted = samples[stage, 6 + axis]
            carried[stage, axis] = after[stage, axis] = decay[axis] * wanted
            if feed_forward:
                after[stage, axis] = wanted + period_s * samples[stage, 10 + axis]
    position, velocities = samples[:, 2:4], samples[:, 6:8]
    chain_rows(position, velocities, after, carried, push, pole, feedback, lagged, rows, terminal)


@compiled(*3 * [ANY_VECTOR], ANY_MATRIX, *STEADY, MATRIX, MATRIX, VECTOR, *TARGET)
def steady_problem(
    motion: Array,
    actuator: Array,
    disturbance: Array,
    samples: Array,
    bounds: Array,
    share: Array,
    lowest: Array,
    highest: Array,
    most_turned_rad: float,
    gravity_m_s2: float,
    decay: Array,
    period_s: float,
    feed_forward: bool,
    push: Array,
    pole: Array,
    feedback: Array,
    lagged: bool,
    gain: Array,
    aim: Array,
    first: Array,
    load: Array,
    rows: Array,
    terminal: Array,
    low: Array,
    high: Array,
) -> bool:
    """Cut the reference of a control step, and put the problem of the vertical and of yaw together.

    Parameters
    ----------
    motion, actuator, disturbance
        The estimate.
    samples, lowest, highest, most_turned_rad, aim
        The reference, its bounds, and what it is cut to (`cut_reference`).
    gravity_m_s2
        Pushes downwards, besides the disturbance.
    decay, period_s, feed_forward, push, pole, feedback, lagged, rows, terminal
        As in `steady_rows`.
    gain
        Acceleration per actuator, shape (2,).
    first
        Set to position, velocity[, actuator] of stage 1, shape (levels, 2).
    load
        Set to the acceleration that acts at every stage, shape (2,).
    bounds, share, low, high
        As in `cut_to_bounds`.

    Returns
    -------
    bool
        Whether the measured velocity is within its bounds.
    """
    cut_reference(samples, motion[3], lowest, highest, most_turned_rad, aim)
    chain_state(motion, actuator, 2, first)
    load[0], load[1] = disturbance[2] - gravity_m_s2, disturbance[3]
    steady_rows(aim, decay, period_s, feed_forward, push, pole, feedback, lagged, rows, terminal)
    cut_to_balance(rows, bounds, load, gain, share, low, high)
    within = True
    for axis in range(2):
        within &= low[0, 2 + axis] <= first[1, axis] <= high[0, 2 + axis]
    return within


@part
def horizontal_rows(
    samples: Array,
    heading: Array,
    decay: Array,
    period_s: float,
    feed_forward: bool,
    push: Array,
    pole: Array,
    feedback: Array,
    lagged: bool,
    rows: Array,
    terminal: Array,
) -> None:
    """Reference of the horizontal problem of a vehicle with lags, along a planned heading.

    Velocities and accelerations are those in the body frame in the middle of the periods.

    Parameters
    ----------
    samples
        Reference: columns 0 to 1 position, 4 to 5 velocity, 8 to 9 acceleration (inertial), shape (N, 12).
    heading
        Planned, at least N + 1.
    decay
        F without turning, shape (2,).
    feed_forward
        As in `steady_rows`.
    push, pole, feedback, lagged, rows, terminal
        As in `chain_rows`.
    """
    stages = len(samples)
    velocity, carried, after = np.empty((stages, 2)), np.empty((stages, 2)), np.empty((stages, 2))
    middle = 0.5 * (heading[1] + heading[0])
    c, s = math.cos(middle), math.sin(middle)
    for stage in range(stages):
        v_x, v_y = samples[stage, 4], samples[stage, 5]
        forward, left = c * v_x + s * v_y, c * v_y - s * v_x
        turn = heading[stage + 1] - heading[stage]
        velocity[stage, 0], velocity[stage, 1] = forward, left
        carried[stage, 0] = decay[0] * forward + turn * left
        carried[stage, 1] = decay[1] * left - turn * forward
        if stage + 2 < len(heading):
            middle = 0.5 * (heading[stage + 2] + heading[stage + 1])
            c, s = math.cos(middle), math.sin(middle)
        if feed_forward:
            v_x, v_y = v_x + period_s * samples[stage, 8], v_y + period_s * samples[stage, 9]
            after[stage, 0], after[stage, 1] = c * v_x + s * v_y, c * v_y - s * v_x
        else:
            after[stage, 0], after[stage, 1] = carried[stage, 0], carried[stage, 1]
    chain_rows(samples[:, :2], velocity, after, carried, push, pole, feedback, lagged, rows, terminal)


@compiled(
    *3 * [ANY_VECTOR], ANY_MATRIX, ANY_VECTOR, MATRIX, MATRIX, VECTOR, NUMBER, FLAG, VECTOR, VECTOR,
    ANY_VECTOR, FLAG, ANY_VECTOR, MATRIX, MATRIX, VECTOR, MATRIX, MATRIX,
)  # fmt: skip
def horizontal_problem(
    motion: Array,
    actuator: Array,
    load: Array,
    samples: Array,
    heading: Array,
    bounds: Array,
    share: Array,
    decay: Array,
    period_s: float,
    feed_forward: bool,
    push: Array,
    pole: Array,
    feedback: Array,
    lagged: bool,
    gain: Array,
    first: Array,
    rows: Array,
    terminal: Array,
    low: Array,
    high: Array,
) -> None:
    """Put the horizontal problem of a vehicle with lags together.

    Parameters
    ----------
    motion, actuator
        The estimate.
    load
        Acceleration that acts at every stage, body frame, shape (2,).
    samples, heading, decay, period_s, feed_forward, push, pole, feedback, lagged, rows, terminal
        As in `horizontal_rows`.
    gain, first
        As in `steady_problem`.
    bounds, share, low, high
        As in `cut_to_bounds`.
    """
    chain_state(motion, actuator, 0, first)
    horizontal_rows(
        samples, heading, decay, period_s, feed_forward, push, pole, feedback, lagged, rows, terminal
    )
    cut_to_balance(rows, bounds, load, gain, share, low, high)


@compiled(ANY_VECTOR, ANY_VECTOR, NUMBER, NUMBER)
def heading_moved(heading: Array, known: Array, tolerance: float, turn_tolerance: float) -> bool:
    """Whether a heading plan differs from a known one, or what it turns per period does, by a tolerance."""
    for stage in range(len(heading)):
        moved = heading[stage] - known[stage]
        if not abs(moved) < tolerance:
            return True
        if stage > 0 and not abs(moved - (heading[stage - 1] - known[stage - 1])) < turn_tolerance:
            return True
    return False


@compiled(ANY_VECTOR, VECTOR, BLOCKS, BLOCKS)
def turning(heading: Array, decay: Array, turn: Array, transition: Array) -> None:
    """Set E and F of the horizontal motion along a heading plan.

    Parameters
    ----------
    heading
        Planned, shape (n,).
    decay
        F without turning, shape (2,).
    turn, transition
        Set to R(psi) in the middle of the periods, shape (n - 1, 2, 2), and to F, shape (n - 2, 2, 2).
    """
    for stage in range(len(turn)):
        middle = 0.5 * (heading[stage + 1] + heading[stage])
        write_turn(turn, stage, math.cos(middle), math.sin(middle))
    for stage in range(len(transition)):
        turned = heading[stage + 1] - heading[stage]
        transition[stage, 0, 0], transition[stage, 1, 1] = decay[0], decay[1]
        transition[stage, 0, 1], transition[stage, 1, 0] = turned, -turned


@compiled(NUMBER, NUMBER, ANY_VECTOR)
def first_order(pole: float, start: float, driven: Array) -> Array:
    """Solve s[i + 1] = pole s[i] + driven[i] from s[0] = start; one value more than `driven` has."""
    response = np.empty(len(driven) + 1)
    response[0] = start
    for stage in range(len(driven)):
        response[stage + 1] = pole * response[stage] + driven[stage]
    return response
