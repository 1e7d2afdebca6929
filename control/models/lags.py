"""Dynamics of axes whose sticks act through first-order lags (docs/formulas.md).

    p+ = p + T v,    v+ = (1 + T k) v + T (b a + disturbance),    a+ = pole a + (1 - pole) (u - gyro v)

with position p, velocity v, actuator a and stick u of each axis.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import ANY_VECTOR, NUMBER, record
from rcopterx.control.models.roll_out import lag_poles
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array


class LagDynamics(NamedTuple):
    """Parameters of the axes x, y, z, yaw or of some of them; arrays of shape (m,)."""

    period_s: float
    gain: Array  # b
    decay: Array  # 1 + T k
    pole: Array
    gyro: Array  # stick that the gyro subtracts per velocity

    @classmethod
    def of(cls, model: Model, period_s: float, axes: slice) -> "LagDynamics":
        """Return the dynamics of some axes of a vehicle."""
        decay = 1.0 + period_s * np.array(model.direct_damping)[axes]
        gyro = np.array(model.rate_feedback)[axes]
        return cls(period_s, model.b[axes], decay, lag_poles(model, period_s)[axes], gyro)

    @property
    def axes(self) -> int:
        """Number of axes m."""
        return len(self.gain)

    def matrices(self) -> tuple[Array, Array]:
        """Return A, shape (3 m, 3 m), and B, shape (3 m, m), without turning; states are p, v and a."""
        m, T = self.axes, self.period_s
        p, v, a = slice(0, m), slice(m, 2 * m), slice(2 * m, 3 * m)
        A, B = np.eye(3 * m), np.zeros((3 * m, m))
        A[p, v] = T * np.eye(m)
        A[v, v] = np.diag(self.decay)
        A[v, a] = T * np.diag(self.gain)
        A[a, v] = -np.diag((1.0 - self.pole) * self.gyro)
        A[a, a] = np.diag(self.pole)
        B[a] = np.diag(1.0 - self.pole)
        return A, B


LAG_DYNAMICS: Final[Any] = record(LagDynamics, NUMBER, *4 * [ANY_VECTOR])


def behind_lag(model: Model, axis: int, lag_s: float, disturbances: int) -> tuple[Array, Array]:
    """Return the continuous dynamics of an axis (x, y, height, yaw): A, shape (n, n), and b, shape (n,).

    States are position, velocity, actuator, and accelerations that last, `disturbances` of them.
    """
    a, b = np.zeros((3 + disturbances, 3 + disturbances)), np.zeros(3 + disturbances)
    a[0, 1] = 1.0
    a[1, 1], a[1, 2], a[1, 3:] = model.direct_damping[axis], model.input_gain[axis], 1.0
    a[2, 1], a[2, 2], b[2] = -model.rate_feedback[axis] / lag_s, -1.0 / lag_s, 1.0 / lag_s
    return a, b
