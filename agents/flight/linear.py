"""Linear systems x' = A x + B u with real or complex numbers."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from rcopterx.vehicles.state import Array

Complex = NDArray[np.complex128]
_PERIOD_DIGITS: Final = 6


def prepared_period(period_s: float) -> float:
    """Period that matrices are prepared for: told apart to 1 us, because times are sums that are rounded."""
    return round(period_s, _PERIOD_DIGITS)


def zero_order_hold(a: NDArray[Any], b: NDArray[Any], time_s: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Exact discretisation over a time in which the input is constant.

    Parameters
    ----------
    a
        Shape (n, n).
    b
        Shape (n, m), or (n,) for one input.
    time_s
        How long.

    Returns
    -------
    tuple
        State after the time per state before it, and per input; shapes of `a` and `b`.
    """
    size = len(a)
    columns = b if b.ndim == 2 else b[:, None]
    whole = np.zeros((size + columns.shape[1],) * 2, dtype=np.result_type(a, b))
    whole[:size, :size], whole[:size, size:] = a, columns
    step: NDArray[Any] = expm(time_s * whole)
    driven = step[:size, size:]
    return step[:size, :size], driven if b.ndim == 2 else driven[:, 0]


def as_complex(matrix: Array) -> Complex:
    """Maps between vectors of the plane that commute with rotations, as complex numbers.

    Parameters
    ----------
    matrix
        Blocks [[a, -b], [b, a]], shape (2 n, 2 m).

    Returns
    -------
    Complex
        Numbers a + i b, shape (n, m).
    """
    return np.asarray(matrix[0::2, 0::2] + 1j * matrix[1::2, 0::2])
