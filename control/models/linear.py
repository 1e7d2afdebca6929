"""Linear systems x' = A x + B u with real or complex numbers."""

from collections.abc import Callable
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from rcopterx.vehicles.state import Array

Complex = NDArray[np.complex128]
PERIOD_DIGITS: Final = 6
"""Matrices are prepared for periods told apart to 1 us, because times are sums that are rounded."""
_MOST_PERIODS: Final = 64

T = TypeVar("T")


class ByPeriod(dict[float, T]):
    """What is prepared for periods, kept because preparing it takes longer than a step.

    Who asks for a period rounds it to `PERIOD_DIGITS`.

    Parameters
    ----------
    prepare
        Prepares for a period [s].
    """

    def __init__(self, prepare: Callable[[float], T]) -> None:
        super().__init__()
        self._prepare = prepare

    def __missing__(self, period_s: float) -> T:
        """Prepare for a period that is new, or was forgotten."""
        if len(self) >= _MOST_PERIODS:
            self.clear()
        made = self[period_s] = self._prepare(period_s)
        return made


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
