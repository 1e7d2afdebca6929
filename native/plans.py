"""Kernels of plans as they are made, travel and are compared (`rcopterx.agents`)."""

from typing import Final

import numpy as np
from numba import types
from numpy.typing import NDArray

from rcopterx.compiling.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    MATRIX,
    NUMBER,
    Array,
    compiled,
    read,
)
from rcopterx.native.bounds import cut_rows

MOST = 2**31 - 1
OCTETS = types.uint8[:, ::1]
JOINING: Final = NUMBER, NUMBER, ANY_VECTOR, ANY_VECTOR, NUMBER
"""Types of what `join_plans` knows of a vehicle, from `coupling` to `period_s`."""


@compiled(ANY_MATRIX, MATRIX, NUMBER, NUMBER, OCTETS)
def packed_plan(
    values: Array, layout: Array, largest: float, tolerance: float, octets: NDArray[np.uint8]
) -> int:
    """Round and pack a trajectory as `rcopterx.bus.trajectory_array` says.

    Parameters
    ----------
    values
        Shape (stages, 12), at least two stages.
    layout
        Units of positions, velocities and accelerations; then how far a velocity moves in a period, and its
        acceleration by a difference, in units: shape (5, 4).
    largest
        Values are cut off beyond it.
    tolerance
        What differs by so many units from what the velocities say is not told.
    octets
        Becomes the lowest bytes of all numbers, then the next ones, shape (4, 12 stages).

    Returns
    -------
    int
        How many rows of `octets` are needed.
    """
    stages = values.shape[0]
    block = 4 * stages
    units, scales = layout[:3], layout[3:]
    highest = 0
    for axis in range(4):
        start = moved = before = earlier = by_rates = 0.0
        for stage in range(stages):
            rate = np.rint(min(max(values[stage, 4 + axis], -largest), largest) / units[1, axis])
            position = np.rint(min(max(values[stage, axis], -largest), largest) / units[0, axis])
            if stage == 0:
                start = place = position
            else:
                moved += before
                place = np.rint(position - (moved * scales[0, axis] + start))
                if abs(place) <= tolerance:
                    place = 0.0
            if stage + 1 < stages:
                after = np.rint(min(max(values[stage + 1, 4 + axis], -largest), largest) / units[1, axis])
                by_rates = (after - rate) * scales[1, axis]
            acceleration = np.rint(min(max(values[stage, 8 + axis], -largest), largest) / units[2, axis])
            push = np.rint(acceleration - by_rates)
            if abs(push) <= tolerance:
                push = 0.0
            # The second difference of the velocities, which begin at rest.
            second = rate - before - (before - earlier)
            earlier, before = before, rate
            at = 4 * stage + axis
            for whole in (second, place, push):
                number = int(min(max(whole, -MOST), MOST))
                folded = 2 * number if number >= 0 else -2 * number - 1
                highest = max(highest, folded)
                for octet in range(4):
                    octets[octet, at] = (folded >> (8 * octet)) & 255
                at += block
    rows = 1
    while rows < 4 and highest >> (8 * rows):
        rows += 1
    return rows


@compiled(read(1, types.uint8), MATRIX, NUMBER, MATRIX)
def unpacked_plan(octets: NDArray[np.uint8], layout: Array, largest: float, values: Array) -> None:
    """Set a trajectory, shape (stages, 12), from its bytes; arguments of `packed_plan`."""
    stages = len(values)
    block = 4 * stages
    rows = len(octets) // (3 * block)
    units, scales = layout[:3], layout[3:]
    for axis in range(4):
        rate, place, push = 4 + axis, axis, 8 + axis
        velocity = step = 0.0
        for stage in range(stages):
            at = 4 * stage + axis
            for column in (rate, place, push):
                folded = np.int64(0)
                for row in range(rows):
                    folded |= np.int64(octets[3 * row * block + at]) << (8 * row)
                # Whole numbers, but floats: exact up to 2^53.
                values[stage, column] = ((folded >> 1) & MOST) ^ -(folded & 1)
                at += block
            # Second differences become velocities.
            step += values[stage, rate]
            velocity += step
            values[stage, rate] = velocity
        moved, start = 0.0, values[0, place]
        for stage in range(stages):
            if stage > 0:
                moved += values[stage - 1, rate]
                values[stage, place] = moved * scales[0, axis] + values[stage, place] + start
            # The last stage accelerates like the one before it.
            last = min(stage, stages - 2)
            values[stage, push] += (values[last + 1, rate] - values[last, rate]) * scales[1, axis]
        for stage in range(stages):
            for kind in range(3):
                column = 4 * kind + axis
                value = values[stage, column] * units[kind, axis]
                values[stage, column] = min(max(value, -largest), largest)


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


@compiled(*4 * [ANY_MATRIX], ANY_VECTOR, *JOINING, MATRIX, MATRIX)
def join_plans(
    horizontal: Array,
    steady: Array,
    horizontal_inputs: Array,
    steady_inputs: Array,
    actuator: Array,
    coupling: float,
    pole: float,
    low: Array,
    high: Array,
    period_s: float,
    inputs: Array,
    samples: Array,
) -> None:
    """Plan of four axes whose velocities and accelerations are the differences of its positions.

    Parameters
    ----------
    horizontal, steady
        Positions of x and y, and of height and yaw, shape (N + 1 or more, 2).
    horizontal_inputs, steady_inputs
        Shape (N - 1, 2).
    actuator, coupling, pole
        Inputs after their lag, shape (4,); else as in `turned_by_thrust`, whose sticks are taken from yaw's.
    low, high
        Limits of the inputs, shape (4,).
    inputs, samples
        Set to the inputs of all axes within them, shape (N - 1, 4), and to the trajectory, shape (N, 12).
        Stages whose acceleration would need positions beyond the given ones accelerate like the last one that
        needs none.
    """
    turned = turned_by_thrust(coupling, pole, actuator[2], steady_inputs[:, 0])
    for stage in range(len(inputs)):
        for axis in range(2):
            inputs[stage, axis] = horizontal_inputs[stage, axis]
            inputs[stage, 2 + axis] = steady_inputs[stage, axis]
        inputs[stage, 3] -= turned[stage]
    cut_rows(inputs, low, high, inputs)
    last = len(steady) - 3
    for axis in range(4):
        flat = horizontal if axis < 2 else steady
        column = axis % 2
        for stage in range(len(samples)):
            samples[stage, axis] = flat[stage, column]
            samples[stage, 4 + axis] = (flat[stage + 1, column] - flat[stage, column]) / period_s
            at = min(stage, last)
            ahead = (flat[at + 2, column] - flat[at + 1, column]) / period_s
            here = (flat[at + 1, column] - flat[at, column]) / period_s
            samples[stage, 8 + axis] = (ahead - here) / period_s
