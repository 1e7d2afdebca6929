"""Kernel that puts the horizontal problem of a vehicle with a tilt model together; see also `cascade`."""

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
from rcopterx.native.cascade import cut_to_bounds, write_turn

TILTED: Final = MATRIX, MATRIX, VECTOR, NUMBER, NUMBER, FLAG
"""Types of what `lateral_problem` knows of a vehicle, from `bounds` to `feed_forward`."""


@part
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
    terminal: Array,
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
    rows, terminal
        Set to position (inertial), velocity (body) and stick, shape (N, 6), and to the last state.
    """
    stages = len(samples)
    for stage in range(stages):
        rows[stage, 4] = rows[stage, 5] = 0.0
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
            ahead = at - before
            needed = np.empty(2)
            for axis in range(2):
                earlier = samples[before, 8 + axis] - drag * samples[before, 4 + axis]
                later = samples[before + 1, 8 + axis] - drag * samples[before + 1, 4 + axis]
                needed[axis] = earlier * (1.0 - ahead) + later * ahead
            rows[stage, 4] = (c * needed[0] + s * needed[1]) / gain[0]
            rows[stage, 5] = (c * needed[1] - s * needed[0]) / gain[1]
    for row in range(len(terminal)):
        terminal[row] = 0.0
    for axis in range(2):
        terminal[axis], terminal[2 + axis] = samples[stages - 1, axis], samples[stages - 1, 4 + axis]


@part
def lateral_first_state(
    motion: Array, core: Array, servo: Array, wind: Array, gain: Array, first: Array
) -> None:
    """Set the first state of the horizontal problem of a vehicle with a tilt model.

    Parameters
    ----------
    motion
        Position, heading, velocities (body), shape (8,).
    core, servo, wind
        Rotor and body, actuators of pitch and roll (body), and wind, as estimated.
    gain
        Demand per stick, shape (2,).
    first
        Set to position, velocity, core, demands of the actuators, wind: all inertial, shape (n,).
    """
    c, s = math.cos(motion[3]), math.sin(motion[3])
    first[0], first[1] = motion[0], motion[1]
    first[2], first[3] = c * motion[4] - s * motion[5], s * motion[4] + c * motion[5]
    behind = 4 + len(core)
    for row in range(len(core)):
        first[4 + row] = core[row]
    pitch, roll = servo[0] * gain[0], servo[1] * gain[1]
    first[behind], first[behind + 1] = c * pitch - s * roll, s * pitch + c * roll
    for axis in range(2):
        first[behind + 2 + axis] = wind[axis]


@compiled(*5 * [ANY_VECTOR], ANY_MATRIX, ANY_VECTOR, *TILTED, VECTOR, BLOCKS, BLOCKS, *TARGET)
def lateral_problem(
    motion: Array,
    core: Array,
    servo: Array,
    wind: Array,
    trim: Array,
    samples: Array,
    heading: Array,
    bounds: Array,
    share: Array,
    gain: Array,
    drag: float,
    lead: float,
    feed_forward: bool,
    first: Array,
    turn: Array,
    middle_turn: Array,
    rows: Array,
    terminal: Array,
    low: Array,
    high: Array,
) -> None:
    """Put the horizontal problem of a vehicle with a tilt model together.

    Parameters
    ----------
    motion, core, servo, wind, gain, first
        As in `lateral_first_state`.
    trim
        Offsets of the sticks, which are their balance, shape (2,).
    samples, heading, drag, lead, feed_forward, turn, middle_turn, rows, terminal
        As in `lateral_reference`.
    bounds, share, low, high
        As in `cut_to_bounds`.
    """
    lateral_first_state(motion, core, servo, wind, gain, first)
    lateral_reference(samples, heading, gain, drag, lead, feed_forward, turn, middle_turn, rows, terminal)
    cut_to_bounds(rows, bounds, trim, share, low, high)
