"""Kernels of plans as they are made and compared (`rcopterx.agents`)."""

from typing import Final

import numpy as np

from rcopterx.compiling.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    MATRIX,
    NUMBER,
    Array,
    compiled,
)
from rcopterx.native.bounds import cut_rows

JOINING: Final = NUMBER, NUMBER, ANY_VECTOR, ANY_VECTOR, NUMBER
"""Types of what `join_plans` knows of a vehicle, from `coupling` to `period_s`."""


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
