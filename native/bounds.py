"""Kernels of bounds: checks of plans, and quadratic programs (`rcopterx.control.controllers`).

Arrays of rows have shape (N, r); bounds have it too, or (1, r) where they are the same at every stage. The
bounds of inputs, columns `first` to `last`, are hard.
"""

from rcopterx.compiling.compiled import (
    ANY_MATRIX,
    ANY_VECTOR,
    MATRIX,
    NUMBER,
    Array,
    compiled,
    part,
)


@compiled(ANY_MATRIX, ANY_VECTOR, ANY_VECTOR)
def rows_within(values: Array, low: Array, high: Array) -> bool:
    """Whether all rows lie between two others."""
    for row in range(values.shape[0]):
        for column in range(values.shape[1]):
            if not low[column] <= values[row, column] <= high[column]:
                return False
    return True


@compiled(ANY_MATRIX, ANY_VECTOR, ANY_VECTOR, MATRIX)
def cut_rows(values: Array, low: Array, high: Array, cut: Array) -> None:
    """Set rows to others that are cut to bounds; what is no number stays none."""
    for row in range(values.shape[0]):
        for column in range(values.shape[1]):
            value = values[row, column]
            if value < low[column]:
                value = low[column]
            elif value > high[column]:
                value = high[column]
            cut[row, column] = value


@compiled(ANY_MATRIX, NUMBER, ANY_VECTOR, ANY_VECTOR, NUMBER, MATRIX)
def cut_reference(
    samples: Array, yaw_rad: float, low: Array, high: Array, most_turned_rad: float, cut: Array
) -> None:
    """Set a reference to another one that is cut to bounds, its headings to some turns from the present one.

    Parameters
    ----------
    samples
        Shape (N, 12).
    yaw_rad, most_turned_rad
        Present heading, and how far the reference may turn away from it.
    low, high
        Bounds, shape (12,); those of headings are not used.
    cut
        Set to the reference that is cut.
    """
    for row in range(samples.shape[0]):
        for column in range(samples.shape[1]):
            least, most = low[column], high[column]
            if column == 3:
                least, most = yaw_rad - most_turned_rad, yaw_rad + most_turned_rad
            value = samples[row, column]
            if value < least:
                value = least
            elif value > most:
                value = most
            cut[row, column] = value


@compiled(*3 * [MATRIX])
def move_bounds_on(side: Array, multipliers: Array, bounded: Array) -> None:
    """Let what presses do so one stage earlier, where rows are `bounded`; arguments as in `press`."""
    stages, count = side.shape
    for stage in range(stages):
        after = min(stage + 1, stages - 1)
        for row in range(count):
            side[stage, row] = side[after, row] * bounded[stage, row]
        if stage < stages - 2:
            for axis in range(multipliers.shape[1]):
                multipliers[stage, axis] = multipliers[stage + 1, axis]


@part
def add_penalties(weights: Array, penalty: Array, side: Array, of: Array, total: Array) -> None:
    """Set weights of the rows with the penalties of what presses, and what presses there.

    Parameters
    ----------
    weights, penalty, side
        As in `pull_at`.
    of
        Becomes the present sides; without stages it stays.
    total
        Becomes the weights.
    """
    for stage in range(len(weights)):
        for row in range(weights.shape[1]):
            pressed = side[stage, row] != 0.0
            total[stage, row] = weights[stage, row] + penalty[stage, row] if pressed else weights[stage, row]
            if stage < len(of):
                of[stage, row] = side[stage, row]


@part
def differ(one: Array, other: Array) -> bool:
    """Whether any number of an array differs from that of another one with as many rows or more."""
    for row in range(len(one)):
        for column in range(one.shape[1]):
            if one[row, column] != other[row, column]:
                return True
    return False


@part
def any_nonzero(values: Array) -> bool:
    """Whether any number is not zero."""
    for row in range(len(values)):
        for column in range(values.shape[1]):
            if values[row, column] != 0.0:
                return True
    return False


@part
def pull_at(
    values: Array,
    rows: Array,
    weights: Array,
    penalty: Array,
    side: Array,
    multipliers: Array,
    lower: Array,
    upper: Array,
    first: int,
    pull: Array,
) -> None:
    """Set the derivative of the augmented Lagrangian by the rows.

    Parameters
    ----------
    values, rows, weights
        Present rows, their reference and cost.
    penalty
        Weights of the squared distance to an active bound.
    side
        -1 or 1 where the lower or upper bound is active.
    multipliers
        Of the inputs, shape (N, m).
    """
    stages, count = values.shape
    last = first + multipliers.shape[1]
    for stage in range(stages):
        at = stage if len(lower) > 1 else 0
        for row in range(count):
            pulled = weights[stage, row] * (values[stage, row] - rows[stage, row])
            if side[stage, row] != 0.0:
                bound = upper[at, row] if side[stage, row] > 0.0 else lower[at, row]
                pulled += penalty[stage, row] * (values[stage, row] - bound)
                if first <= row < last:
                    pulled += multipliers[stage, row - first]
            pull[stage, row] = pulled


@part
def press(
    values: Array,
    bounded: Array,
    multipliers: Array,
    lower: Array,
    upper: Array,
    first: int,
    penalty: float,
    side: Array,
) -> bool:
    """Find which bound each row presses on.

    Parameters
    ----------
    values, bounded
        Present rows; positive where a bound binds.
    multipliers
        Of the inputs, shape (N, m); inputs press by them over the penalty beyond their value. Set to zero
        where nothing presses any more.
    side
        Set to -1, 0 or 1.

    Returns
    -------
    bool
        Whether all is as it was.
    """
    stages, count = values.shape
    last = first + multipliers.shape[1]
    presses, same = False, True
    for stage in range(stages):
        at = stage if len(lower) > 1 else 0
        for row in range(count):
            found = 0.0
            if bounded[stage, row] > 0.0:
                value = values[stage, row]
                if first <= row < last:
                    value += multipliers[stage, row - first] / penalty
                if value > upper[at, row]:
                    found = 1.0
                elif value < lower[at, row]:
                    found = -1.0
            if found != 0.0:
                presses = True
            if found != side[stage, row]:
                same = False
                side[stage, row] = found
    if not presses:
        for stage in range(stages):
            for axis in range(multipliers.shape[1]):
                multipliers[stage, axis] = 0.0
    return same


@part
def update_multipliers(
    values: Array, multipliers: Array, lower: Array, upper: Array, first: int, penalty: float
) -> float:
    """One step of the method of multipliers, in place, but for the last stage, which has no input.

    Returns
    -------
    float
        Largest distance of an input to its bound, outside, or inside where it presses.
    """
    largest = 0.0
    for stage in range(values.shape[0] - 1):
        for axis in range(multipliers.shape[1]):
            pressed = values[stage, first + axis] + multipliers[stage, axis] / penalty
            within = min(max(pressed, lower[0, first + axis]), upper[0, first + axis])
            updated = penalty * (pressed - within)
            largest = max(largest, abs(updated - multipliers[stage, axis]) / penalty)
            multipliers[stage, axis] = updated
    return largest
