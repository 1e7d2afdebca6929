"""Parts of the kernels of the Kalman filters: covariances that are predicted and corrected."""

import math

import numpy as np

from rcopterx.compiling.compiled import Array, part


@part
def add_product(total: Array, left: Array, right: Array) -> None:
    """Add the product of two matrices to a third one; entries of the left one that are zero cost nothing."""
    for row in range(left.shape[0]):
        for inner in range(left.shape[1]):
            factor = left[row, inner]
            if factor != 0.0:
                for column in range(right.shape[1]):
                    total[row, column] += factor * right[inner, column]


@part
def propagate(transition: Array, covariance: Array, process: Array) -> None:
    """Replace P by F P F' + Q, shapes (n, n); entries of F that are zero cost nothing."""
    size = transition.shape[0]
    moved = np.zeros((size, size))
    add_product(moved, transition, covariance)
    # Row i of the transpose is the sum of F_ij times column j of F P: P is symmetric, so rows serve as well.
    turned = np.empty((size, size))
    for row in range(size):
        for column in range(size):
            turned[column, row] = moved[row, column]
            covariance[row, column] = process[row, column]
    add_product(covariance, transition, turned)


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
def joseph(covariance: Array, gain: Array, spread: Array, observed: Array, variance: Array) -> None:
    """Replace P by (I - K H) P (I - K H)' + K V K', which stays symmetric and positive whatever the rounding.

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
    for row in range(size):
        for number in range(count):
            for column in range(size):
                covariance[row, column] -= gain[number, row] * spread[number, column]
    # Each row of the product needs no other one.
    for row in range(size):
        kept = covariance[row].copy()
        for number in range(count):
            seen = -variance[number] * gain[number, row]
            for inner in range(size):
                if observed[number, inner] != 0.0:
                    seen += kept[inner] * observed[number, inner]
            for column in range(size):
                covariance[row, column] -= seen * gain[number, column]


@part
def corrected(state: Array, covariance: Array, observed: Array, surprise: Array, variance: Array) -> bool:
    """Correct a state by what it does not explain of measurements; shapes of `joseph`, both in place.

    Returns
    -------
    bool
        Whether H P H' + V is definite; if not, nothing is changed.
    """
    count, size = observed.shape
    spread = np.zeros((count, size))
    add_product(spread, observed, covariance)
    innovation = np.zeros((count, count))
    for number in range(count):
        for other in range(count):
            for inner in range(size):
                if observed[other, inner] != 0.0:
                    innovation[number, other] += spread[number, inner] * observed[other, inner]
        innovation[number, number] += variance[number]
    if not factorized(innovation):
        return False
    gain = spread.copy()
    solve_factorized(innovation, gain)
    for number in range(count):
        for row in range(size):
            state[row] += gain[number, row] * surprise[number]
    joseph(covariance, gain, spread, observed, variance)
    return True
