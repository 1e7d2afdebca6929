"""Linear systems, x' = A x + B u or x+ = A x + B u, with real or complex numbers."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from rcopterx.vehicles.state import Array

Complex = NDArray[np.complex128]
PERIOD_DIGITS: Final = 6  # of seconds: sums of rounded periods are then equal, and found in caches


def zero_order_hold(a: NDArray[Any], b: NDArray[Any], time_s: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the exact discretisation over a time with constant input: transition and response to the input.

    `a` has shape (n, n), `b` shape (n, m), or (n,) for one input; the results have the same shapes.
    """
    size = len(a)
    columns = b if b.ndim == 2 else b[:, None]
    whole = np.zeros((size + columns.shape[1],) * 2, dtype=np.result_type(a, b))
    whole[:size, :size], whole[:size, size:] = a, columns
    step: NDArray[Any] = expm(time_s * whole)
    driven = step[:size, size:]
    return step[:size, :size], driven if b.ndim == 2 else driven[:, 0]


def noise_over(a: Array, density: Array, time_s: float) -> Array:
    """Return the covariance that white noise adds to states over a time, shape (n, n): Van Loan's integral.

    `density` has the spectral density of the noise of each derivative, shape (n,).
    """
    size = len(a)
    step = expm(time_s * np.block([[-a, np.diag(density)], [np.zeros((size, size)), a.T]]))
    return np.asarray(step[size:, size:].T @ step[:size, size:])


def regulator(A: NDArray[Any], B: NDArray[Any], Q: Array, R: Array) -> NDArray[Any]:
    """Return the feedback K, shape (m, n), of the linear-quadratic regulator u = -K x of x+ = A x + B u."""
    back = B.conj().T @ solve_discrete_are(A, B, Q, R)
    return np.asarray(np.linalg.solve(R + back @ B, back @ A))


def steady_filter(
    A: NDArray[Any], H: NDArray[Any], Q: NDArray[Any], R: Array
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the covariance of predictions, and the gain K, shape (n, p), of a steady Kalman filter.

    Measured is H x, shape (p,); `Q` and `R` are the covariances of the process and of the measurement.
    """
    P = solve_discrete_are(A.conj().T, H.conj().T, Q, R)
    seen = P @ H.conj().T
    S = H @ seen + R
    return P, np.asarray(np.linalg.solve(S.conj().T, seen.conj().T).conj().T)


def as_complex(matrix: Array) -> Complex:
    """Return the complex form, shape (n, m), of a map of shape (2 n, 2 m) that commutes with rotations."""
    return np.asarray(matrix[0::2, 0::2] + 1j * matrix[1::2, 0::2])
