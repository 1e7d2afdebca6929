"""Kernels of plans as they travel and as they are compared (`rcopterx.agents`)."""

import math

import numpy as np
from numpy.typing import NDArray

from rcopterx.native.compiled import ANY_MATRIX, ANY_VECTOR, COUNT, NUMBER, Array, compiled, read

MOST = 2**31 - 1


@compiled(*3 * [ANY_MATRIX], NUMBER, NUMBER)
def packed_plan(
    values: Array, units: Array, scales: Array, largest: float, tolerance: float
) -> tuple[NDArray[np.uint8], int]:
    """Round and pack a trajectory as `rcopterx.bus.trajectory_array` says.

    Parameters
    ----------
    values
        Shape (stages, 12), at least two stages.
    units
        Of positions, velocities and accelerations, shape (3, 4).
    scales
        How far a velocity moves in a period, and its acceleration by a difference, in units, shape (2, 4).
    largest
        Values are cut off beyond it.
    tolerance
        What differs by so many units from what the velocities say is not told.

    Returns
    -------
    tuple
        Lowest bytes of all numbers, then the next ones, shape (4, 12 stages), and how many rows of them are
        needed.
    """
    stages = values.shape[0]
    block = 4 * stages
    octets = np.empty((4, 3 * block), np.uint8)
    highest = 0
    whole = np.empty(3)
    for axis in range(4):
        start = moved = before = earlier = by_rates = 0.0
        for stage in range(stages):
            rate = np.rint(min(max(values[stage, 4 + axis], -largest), largest) / units[1, axis])
            # The second difference of the velocities, which begin at rest.
            whole[0] = rate - before - (before - earlier)
            position = np.rint(min(max(values[stage, axis], -largest), largest) / units[0, axis])
            if stage == 0:
                start = position
                whole[1] = position
            else:
                moved += before
                whole[1] = np.rint(position - (moved * scales[0, axis] + start))
                if abs(whole[1]) <= tolerance:
                    whole[1] = 0.0
            if stage + 1 < stages:
                after = np.rint(min(max(values[stage + 1, 4 + axis], -largest), largest) / units[1, axis])
                by_rates = (after - rate) * scales[1, axis]
            acceleration = np.rint(min(max(values[stage, 8 + axis], -largest), largest) / units[2, axis])
            whole[2] = np.rint(acceleration - by_rates)
            if abs(whole[2]) <= tolerance:
                whole[2] = 0.0
            earlier, before = before, rate
            for kind in range(3):
                number = int(min(max(whole[kind], -MOST), MOST))
                folded = 2 * number if number >= 0 else -2 * number - 1
                highest = max(highest, folded)
                place = kind * block + 4 * stage + axis
                for octet in range(4):
                    octets[octet, place] = (folded >> (8 * octet)) & 255
    rows = 1
    while rows < 4 and highest >> (8 * rows):
        rows += 1
    return octets, rows


@compiled(read(1, "uint8"), COUNT, ANY_MATRIX, ANY_MATRIX, NUMBER)
def unpacked_plan(
    octets: NDArray[np.uint8], stages: int, units: Array, scales: Array, largest: float
) -> Array:
    """Trajectory of shape (stages, 12) from its bytes; arguments of `packed_plan`."""
    block = 4 * stages
    rows = len(octets) // (3 * block)
    values = np.empty((stages, 12))
    whole = np.empty((3, stages), np.int64)
    for axis in range(4):
        for kind in range(3):
            for stage in range(stages):
                folded = np.int64(0)
                for row in range(rows):
                    folded |= np.int64(octets[(3 * row + kind) * block + 4 * stage + axis]) << (8 * row)
                whole[kind, stage] = ((folded >> 1) & MOST) ^ -(folded & 1)
        # Second differences become velocities.
        for _ in range(2):
            for stage in range(1, stages):
                whole[0, stage] += whole[0, stage - 1]
        rates = whole[0]
        moved = np.int64(0)
        for stage in range(stages):
            if stage == 0:
                position = float(whole[1, 0])
            else:
                moved += rates[stage - 1]
                position = moved * scales[0, axis] + whole[1, stage] + whole[1, 0]
            # The last stage accelerates like the one before it.
            at = min(stage, stages - 2)
            acceleration = (rates[at + 1] - rates[at]) * scales[1, axis] + whole[2, stage]
            values[stage, axis] = position * units[0, axis]
            values[stage, 4 + axis] = rates[stage] * units[1, axis]
            values[stage, 8 + axis] = acceleration * units[2, axis]
            for column in range(axis, 12, 4):
                values[stage, column] = min(max(values[stage, column], -largest), largest)
    return values


@compiled(ANY_MATRIX, ANY_MATRIX, ANY_VECTOR)
def smallest_gaps(first_m: Array, second_m: Array, stiffness: Array) -> tuple[float, float]:
    """Smallest distance of two vehicles at the same stages, in ellipsoids and in metres.

    Parameters
    ----------
    first_m, second_m
        Positions, shape (N, 3).
    stiffness
        What squares of gaps are multiplied by, shape (3,).
    """
    in_ellipsoids, in_m = math.inf, math.inf
    for stage in range(first_m.shape[0]):
        scaled = plain = 0.0
        for axis in range(3):
            square = (first_m[stage, axis] - second_m[stage, axis]) ** 2
            scaled += square * stiffness[axis]
            plain += square
        in_ellipsoids, in_m = min(in_ellipsoids, scaled), min(in_m, plain)
    return math.sqrt(in_ellipsoids), math.sqrt(in_m)
