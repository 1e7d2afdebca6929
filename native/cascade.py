"""Kernels that put the cascade's problems together (`rcopterx.agents.controllers.cascade`)."""

import math

import numpy as np

from rcopterx.native.bounds import cut_rows
from rcopterx.native.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    BLOCKS,
    FLAG,
    MATRIX,
    NUMBER,
    VECTOR,
    Array,
    compiled,
    part,
)


@part
def write_turn(turn: Array, stage: int, cosine: float, sine: float) -> None:
    """Write R(psi) of a heading into its stage, of shape (s, 2, 2)."""
    turn[stage, 0, 0] = turn[stage, 1, 1] = cosine
    turn[stage, 1, 0] = sine
    turn[stage, 0, 1] = -sine


@compiled(ANY_MATRIX, ANY_VECTOR, VECTOR, NUMBER, NUMBER, FLAG, BLOCKS, BLOCKS, MATRIX)
def lateral_reference(
    samples: Array,
    heading: Array,
    gain: Array,
    drag: float,
    lead: float,
    feed_forward: bool,
    turn: Array,
    middle_turn: Array,
    rows: Array,
) -> None:
    """Reference of the horizontal problem of a vehicle with a tilt model, along a planned heading.

    Parameters
    ----------
    samples
        Reference: columns 0 to 1 position, 4 to 5 velocity, 8 to 9 acceleration (inertial), shape (N, 12).
    heading
        Planned, at least N.
    gain
        Demand per stick, shape (2,).
    drag
        Acceleration per velocity.
    lead
        Stages by which demands are ahead of the accelerations that they make.
    feed_forward
        Whether sticks are those that fly the reference, or none.
    turn, middle_turn
        Set to R(psi) of the stages and in the middle of the periods, shapes (N, 2, 2) and (N - 1, 2, 2).
    rows
        Set to position (inertial), velocity (body) and stick, shape (N, 6).
    """
    stages = len(samples)
    rows[:, 4:] = 0.0
    for stage in range(stages):
        c, s = math.cos(heading[stage]), math.sin(heading[stage])
        write_turn(turn, stage, c, s)
        rows[stage, 0], rows[stage, 1] = samples[stage, 0], samples[stage, 1]
        v_x, v_y = samples[stage, 4], samples[stage, 5]
        rows[stage, 2], rows[stage, 3] = c * v_x + s * v_y, c * v_y - s * v_x
    for stage in range(stages - 1):
        middle = 0.5 * (heading[stage] + heading[stage + 1])
        c, s = math.cos(middle), math.sin(middle)
        write_turn(middle_turn, stage, c, s)
        if feed_forward:
            at = min(stage + lead, stages - 1.0)
            before = min(int(at), stages - 2)
            share = at - before
            needed = np.empty(2)
            for axis in range(2):
                earlier = samples[before, 8 + axis] - drag * samples[before, 4 + axis]
                later = samples[before + 1, 8 + axis] - drag * samples[before + 1, 4 + axis]
                needed[axis] = earlier * (1.0 - share) + later * share
            rows[stage, 4] = (c * needed[0] + s * needed[1]) / gain[0]
            rows[stage, 5] = (c * needed[1] - s * needed[0]) / gain[1]


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
    rows[stages - 1, 2 * axes :] = 0.0
    for axis in range(axes):
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


@compiled(ANY_MATRIX, VECTOR, NUMBER, FLAG, VECTOR, VECTOR, ANY_VECTOR, FLAG, MATRIX, VECTOR)
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
    """Reference of the vertical and yaw, whose frame is the inertial one.

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
    after, carried = np.empty((stages, 2)), np.empty((stages, 2))
    for stage in range(stages):
        for axis in range(2):
            velocity = samples[stage, 6 + axis]
            after[stage, axis] = carried[stage, axis] = decay[axis] * velocity
            if feed_forward:
                after[stage, axis] = velocity + period_s * samples[stage, 10 + axis]
    position, velocities = samples[:, 2:4], samples[:, 6:8]
    chain_rows(position, velocities, after, carried, push, pole, feedback, lagged, rows, terminal)


@compiled(ANY_MATRIX, ANY_VECTOR, VECTOR, NUMBER, FLAG, VECTOR, VECTOR, ANY_VECTOR, FLAG, MATRIX, VECTOR)
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
    """Reference of the horizontal motion in the body frame of a planned heading, for a vehicle with lags.

    Velocities are turned by the heading in the middle of the periods.

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
    velocity, after, carried = np.empty((stages, 2)), np.empty((stages, 2)), np.empty((stages, 2))
    middle = 0.5 * (heading[1] + heading[0])
    c, s = math.cos(middle), math.sin(middle)
    for stage in range(stages):
        x, y = samples[stage, 4], samples[stage, 5]
        forward, left = c * x + s * y, c * y - s * x
        turn = heading[stage + 1] - heading[stage]
        velocity[stage, 0], velocity[stage, 1] = forward, left
        carried[stage, 0] = decay[0] * forward + turn * left
        carried[stage, 1] = decay[1] * left - turn * forward
        after[stage] = carried[stage]
        if stage + 2 < len(heading):
            middle = 0.5 * (heading[stage + 2] + heading[stage + 1])
            c, s = math.cos(middle), math.sin(middle)
        if feed_forward:
            x, y = x + period_s * samples[stage, 8], y + period_s * samples[stage, 9]
            after[stage, 0], after[stage, 1] = c * x + s * y, c * y - s * x
    chain_rows(samples[:, :2], velocity, after, carried, push, pole, feedback, lagged, rows, terminal)


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


@compiled(MATRIX, *5 * [ANY_VECTOR], NUMBER, VECTOR, VECTOR)
def cut_to_bounds(
    rows: Array,
    lower: Array,
    upper: Array,
    balance: Array,
    least: Array,
    most: Array,
    narrowest: float,
    low: Array,
    high: Array,
) -> None:
    """Bounds of two axes' rows whose inputs balance what pushes; inputs among the rows are cut to them.

    Parameters
    ----------
    rows
        Position, velocity, input, shape (N, 6), changed in place.
    lower, upper
        Shape (6,), of the inputs without balance.
    balance
        Shape (2,).
    least, most
        Share of the range to plan with, shape (2,); where the balance leaves no more than `narrowest` of it,
        the whole range counts.
    low, high
        Set to the bounds, shape (6,).
    """
    low[:], high[:] = lower, upper
    for axis in range(2):
        at = 4 + axis
        below, above = lower[at] + balance[axis], upper[at] + balance[axis]
        if min(above, most[axis]) - max(below, least[axis]) > narrowest:
            below, above = max(below, least[axis]), min(above, most[axis])
        low[at], high[at] = below, above
        for stage in range(len(rows)):
            rows[stage, at] = min(max(rows[stage, at], below), above)


@compiled(ANY_MATRIX, ANY_MATRIX, NUMBER, MATRIX)
def plan_samples(horizontal: Array, steady: Array, period_s: float, samples: Array) -> None:
    """Set a trajectory, shape (N, 12), whose velocities and accelerations are differences of positions.

    Positions are given of x and y, and of height and yaw, shapes (at least N + 1, 2). Stages whose
    acceleration would need positions beyond them accelerate like the last one that needs none.
    """
    last = min(len(horizontal), len(steady)) - 3
    for stage in range(len(samples)):
        for axis in range(4):
            flat, column = (horizontal, axis) if axis < 2 else (steady, axis - 2)
            samples[stage, axis] = flat[stage, column]
            samples[stage, 4 + axis] = (flat[stage + 1, column] - flat[stage, column]) / period_s
            at = min(stage, last)
            ahead = (flat[at + 2, column] - flat[at + 1, column]) / period_s
            here = (flat[at + 1, column] - flat[at, column]) / period_s
            samples[stage, 8 + axis] = (ahead - here) / period_s


@compiled(NUMBER, NUMBER, NUMBER, ANY_VECTOR)
def turned_by_thrust(coupling: float, pole: float, actuator: float, thrust: Array) -> Array:
    """What a plan of thrust sticks turns the vehicle by, as yaw sticks.

    Parameters
    ----------
    coupling
        Yaw stick per thrust that the rotors have not followed.
    pole, actuator
        Of the thrust's lag, and its state at the beginning.
    thrust
        Sticks, shape (k,).
    """
    turns = np.empty(len(thrust))
    for stage in range(len(thrust)):
        turns[stage] = coupling * (thrust[stage] - actuator)
        actuator = pole * actuator + (1.0 - pole) * thrust[stage]
    return turns


@compiled(ANY_MATRIX, ANY_MATRIX, ANY_VECTOR, ANY_VECTOR, ANY_VECTOR)
def joined_inputs(horizontal: Array, steady: Array, turns: Array, low: Array, high: Array) -> Array:
    """Sticks of a plan within their limits, shape (N - 1, 4).

    Parameters
    ----------
    horizontal, steady
        Pitch and roll, and thrust and yaw, shapes (N - 1, 2).
    turns
        What the thrust turns by, taken from the yaw, shape (N - 1,).
    low, high
        Shape (4,).
    """
    inputs = np.empty((len(horizontal), 4))
    for stage in range(len(inputs)):
        inputs[stage, 0], inputs[stage, 1] = horizontal[stage, 0], horizontal[stage, 1]
        inputs[stage, 2], inputs[stage, 3] = steady[stage, 0], steady[stage, 1] - turns[stage]
    cut_rows(inputs, low, high, inputs)
    return inputs


@compiled(NUMBER, NUMBER, ANY_VECTOR)
def first_order(pole: float, start: float, driven: Array) -> Array:
    """Solve s[i + 1] = pole s[i] + driven[i] from s[0] = start; one value more than `driven` has."""
    response = np.empty(len(driven) + 1)
    response[0] = start
    for stage in range(len(driven)):
        response[stage + 1] = pole * response[stage] + driven[stage]
    return response
