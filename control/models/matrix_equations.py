"""Exponential of a matrix, and the Riccati equation of discrete time, for systems of some twenty states.

They are all that a fleet needs of scipy's linear algebra in flight, which would bring a second copy of BLAS
into each process: 23 MB for a fleet of three.
"""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

PADE_ORDER: Final = 13
PADE_NORM: Final = 5.371920351148152
"""Up to this 1-norm the approximant is exact to double precision (Higham 2005, table 2.3)."""
MOST_DOUBLINGS: Final = 60
"""Eigenvalues of the closed loop closer to the unit circle than 1e-16 are on it."""
SETTLED: Final = 1e-15
"""Relative change of the solution at which doubling ends."""

Matrix = NDArray[Any]


def matrix_exponential(matrix: Matrix) -> Matrix:
    """Exponential of a square matrix of real or complex numbers, by scaling and squaring.

    Parameters
    ----------
    matrix
        Shape (n, n), finite.

    Returns
    -------
    Matrix
        Shape (n, n).

    Notes
    -----
    Higham, N. J. (2005): The scaling and squaring method for the matrix exponential revisited.
    """
    norm = float(np.abs(matrix).sum(axis=0).max(initial=0.0))
    squarings = math.ceil(math.log2(norm / PADE_NORM)) if norm > PADE_NORM else 0
    scaled = matrix / 2.0**squarings
    even = odd = np.zeros_like(scaled)
    power, unit = np.eye(len(scaled), dtype=scaled.dtype), scaled @ scaled
    for order in range(0, PADE_ORDER, 2):
        even = even + _PADE[order] * power
        odd = odd + _PADE[order + 1] * power
        power = power @ unit
    odd = scaled @ odd
    result: Matrix = np.linalg.solve(even - odd, even + odd)
    for _ in range(squarings):
        result = result @ result
    return result


def _pade_coefficients() -> tuple[float, ...]:
    """Of the numerator of the diagonal approximant, constant term first and equal to one."""
    order = PADE_ORDER
    return tuple(
        math.comb(order, k) * math.factorial(2 * order - k) / math.factorial(2 * order)
        for k in range(order + 1)
    )


_PADE: Final = _pade_coefficients()


def riccati_solution(a: Matrix, b: Matrix, q: Matrix, r: Matrix) -> Matrix:
    """Solution X of X = A* X A - A* X B (R + B* X B)^-1 B* X A + Q: the cost of an endless horizon.

    Its feedback stabilizes the system if no state that costs nothing stays or grows by itself. Step k of
    the doubling has the cost of 2^k stages, so a dozen are enough.

    Parameters
    ----------
    a, b
        Dynamics, shapes (n, n) and (n, m), of real or complex numbers.
    q
        Weights of states, Hermitian and not negative, shape (n, n).
    r
        Weights of inputs, Hermitian and positive, shape (m, m).

    Returns
    -------
    Matrix
        Shape (n, n), Hermitian.

    Raises
    ------
    numpy.linalg.LinAlgError
        The cost has no end, for instance because an input cannot reach a state that grows.

    Notes
    -----
    Chu, E. K.-W., Fan, H.-Y., Lin, W.-W., Wang, C.-S. (2004): Structure-preserving algorithms for periodic
    discrete-time algebraic Riccati equations.
    """
    one = np.eye(len(a))
    carried, reach, cost = a, b @ np.linalg.solve(r, b.conj().T), q
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(MOST_DOUBLINGS):
            within = np.linalg.solve(one + reach @ cost, np.hstack((carried, reach)))
            ahead, spread = within[:, : len(a)], within[:, len(a) :]
            added = carried.conj().T @ cost @ ahead
            reach = _hermitian(reach + carried @ spread @ carried.conj().T)
            carried, cost = carried @ ahead, _hermitian(cost + added)
            if not np.isfinite(cost).all():
                break
            if np.abs(added).max() <= SETTLED * np.abs(cost).max():
                return cost
    raise np.linalg.LinAlgError("the Riccati equation has no solution: the cost of its horizon has no end")


def _hermitian(matrix: Matrix) -> Matrix:
    """Without what rounding adds to a Hermitian matrix."""
    half: Matrix = 0.5 * (matrix + matrix.conj().T)
    return half
