"""Linear systems x' = A x + B u with real or complex numbers."""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, TypeVar, TypeVarTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from rcopterx.vehicles.state import Array

Complex = NDArray[np.complex128]
T = TypeVar("T")
Arguments = TypeVarTuple("Arguments")


def cached_by_period(prepare: Callable[[*Arguments, float], T]) -> Callable[[*Arguments, float], T]:
    """Cache results by the last argument, a period; sums of rounded periods are equal within 1 us."""
    cached: Callable[..., T] = lru_cache(maxsize=256)(prepare)

    @wraps(prepare)
    def prepare_once(*arguments: *tuple[*Arguments, float]) -> T:
        *others, period_s = arguments
        return cached(*others, round(period_s, 6))

    return prepare_once


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


def as_complex(matrix: Array) -> Complex:
    """Return the complex form, shape (n, m), of a map of shape (2 n, 2 m) that commutes with rotations."""
    return np.asarray(matrix[0::2, 0::2] + 1j * matrix[1::2, 0::2])
