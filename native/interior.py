"""Kernels of the interior-point method (`rcopterx.control.controllers.chains.interior_point`).

Rows of a problem have shape (N, r); slacks, multipliers and bounds have shape (2, N, r), upper ones first.
"""

import numpy as np

from rcopterx.compiling.compiled import BLOCKS, MATRIX, NUMBER, Array, compiled


@compiled(MATRIX, BLOCKS, MATRIX, BLOCKS, BLOCKS, BLOCKS)
def residual_of(
    values: Array, multipliers: Array, give: Array, slacks: Array, bounds: Array, mask: Array
) -> tuple[Array, float, float]:
    """Residual of the inequalities v - z/w + t = upper and -v - z/w + t = -lower.

    Parameters
    ----------
    values, give
        v and 1/w, shape (N, r).
    multipliers, slacks, bounds, mask
        z, t, right sides, and 1 where there is a bound; shape (2, N, r).

    Returns
    -------
    tuple
        Residual, its largest size, and sum of slacks times multipliers.
    """
    residual = np.empty(slacks.shape)
    largest = together = 0.0
    for bound in range(2):
        sign = 1.0 - 2.0 * bound
        for stage in range(values.shape[0]):
            for row in range(values.shape[1]):
                at = bound, stage, row
                left = (
                    sign * values[stage, row] - give[stage, row] * multipliers[at] + slacks[at] - bounds[at]
                )
                residual[at] = left * mask[at]
                if not abs(residual[at]) <= largest:
                    largest = abs(residual[at])
                together += slacks[at] * multipliers[at]
    return residual, largest, together


@compiled(BLOCKS, BLOCKS, *4 * [MATRIX])
def softened_of(
    slacks: Array, multipliers: Array, give: Array, values: Array, rows: Array, weights: Array
) -> tuple[Array, Array, Array, Array]:
    """What a Newton step of the interior point needs.

    Returns
    -------
    tuple
        t + z/w and z over it, shape (2, N, r); weights of the rows with these; derivative of the cost and of
        the multipliers' part by the rows.
    """
    softened, stiffness = np.empty(slacks.shape), np.empty(slacks.shape)
    total, pull = np.empty(values.shape), np.empty(values.shape)
    for stage in range(values.shape[0]):
        for row in range(values.shape[1]):
            for bound in range(2):
                at = bound, stage, row
                softened[at] = slacks[at] + give[stage, row] * multipliers[at]
                stiffness[at] = multipliers[at] / softened[at]
            weight = weights[stage, row]
            total[stage, row] = weight + stiffness[0, stage, row] + stiffness[1, stage, row]
            error = values[stage, row] - rows[stage, row]
            pull[stage, row] = weight * error + multipliers[0, stage, row] - multipliers[1, stage, row]
    return softened, stiffness, total, pull


@compiled(*4 * [BLOCKS])
def shift_of(stiffness: Array, residual: Array, product: Array, softened: Array) -> tuple[Array, Array]:
    """What residual and complementarity add to the multipliers' step, and to the derivative by the rows."""
    shift = np.empty(stiffness.shape)
    pull = np.empty(stiffness.shape[1:])
    for stage in range(stiffness.shape[1]):
        for row in range(stiffness.shape[2]):
            for bound in range(2):
                at = bound, stage, row
                shift[at] = stiffness[at] * residual[at] - product[at] / softened[at]
            pull[stage, row] = shift[0, stage, row] - shift[1, stage, row]
    return shift, pull


@compiled(MATRIX, MATRIX, *6 * [BLOCKS], NUMBER)
def direction_of(
    values: Array,
    give: Array,
    stiffness: Array,
    shift: Array,
    residual: Array,
    mask: Array,
    slacks: Array,
    multipliers: Array,
    longest: float,
) -> tuple[Array, Array, float]:
    """Steps of slacks and multipliers for a step of the rows.

    Parameters
    ----------
    values
        The rows' step, shape (N, r).
    longest
        Largest length of a step.

    Returns
    -------
    tuple
        Steps of slacks and multipliers, and the length up to which neither becomes negative.
    """
    to_slacks, to_multipliers = np.empty(slacks.shape), np.empty(slacks.shape)
    length = longest
    for bound in range(2):
        sign = 1.0 - 2.0 * bound
        for stage in range(values.shape[0]):
            for row in range(values.shape[1]):
                at = bound, stage, row
                moved = sign * values[stage, row]
                to_multipliers[at] = stiffness[at] * moved + shift[at]
                to_slacks[at] = (give[stage, row] * to_multipliers[at] - residual[at] - moved) * mask[at]
                if slacks[at] > 0.0 and to_slacks[at] < 0.0:
                    length = min(length, -slacks[at] / to_slacks[at])
                if multipliers[at] > 0.0 and to_multipliers[at] < 0.0:
                    length = min(length, -multipliers[at] / to_multipliers[at])
    return to_slacks, to_multipliers, length


@compiled(*4 * [BLOCKS], NUMBER)
def complementarity_ahead(
    slacks: Array, multipliers: Array, to_slacks: Array, to_multipliers: Array, length: float
) -> float:
    """Sum of slacks times multipliers after a step of a length."""
    together = 0.0
    for bound in range(2):
        for stage in range(slacks.shape[1]):
            for row in range(slacks.shape[2]):
                at = bound, stage, row
                together += (slacks[at] + length * to_slacks[at]) * (
                    multipliers[at] + length * to_multipliers[at]
                )
    return together
