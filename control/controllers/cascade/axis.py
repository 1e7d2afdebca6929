"""The task of a control step, and the problem of axes behind lags: heading, height (docs/formulas.md)."""

from typing import Any, Final, NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.compiling.compiled import ANY_MATRIX, ANY_VECTOR, COUNT, MATRIX, VECTOR, compiled, part, record
from rcopterx.control.controllers.cascade.weights import CascadeWeights
from rcopterx.control.controllers.settings import Limits
from rcopterx.control.interfaces import Estimate
from rcopterx.control.models.lags import LAG_DYNAMICS, LagDynamics
from rcopterx.control.models.prediction import ESTIMATE
from rcopterx.control.references.columns import X_ACCELERATION, X_RATE
from rcopterx.control.solver.problem import HARD, PROBLEM, OptimalControlProblem, repeated
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import XD_BODY, YAW, Array

RECOVERY_S: Final = 0.2
"""Time constant with which a velocity measured beyond its limits returns to them.

By noise and gusts a vehicle that flies along a limit is beyond it half of the time, and to be back at the
next stage would take a stick from stop to stop.
"""


def recovery(period_s: float, stages: int) -> Array:
    """Return the share of an excess over velocity limits that is left at every stage, shape (N,)."""
    return np.exp(-period_s / RECOVERY_S * np.arange(float(stages)))


class CascadeTask(NamedTuple):
    """One control step of N planned inputs."""

    estimate: Estimate
    load: Array  # accelerations that sticks balance: `Estimate.disturbance`, and gravity; shape (4,)
    reference: Array  # samples, shape (N + 1, 12)
    limits: Limits
    recovery: Array  # share of an excess over velocity limits that is left at every stage, shape (N,)


LIMITS: Final[Any] = record(Limits, *2 * [ANY_MATRIX], *2 * [ANY_VECTOR])
TASK: Final[Any] = record(CascadeTask, ESTIMATE, VECTOR, ANY_MATRIX, LIMITS, VECTOR)


class LagProblem:
    """Weights and dynamics of axes with N = `stages`; the arrays of a problem are used again for the next.

    With `feed_forward` sticks are referred to those that fly the reference, else its velocity.
    """

    def __init__(
        self,
        axes: slice,
        model: Model,
        period_s: float,
        weights: CascadeWeights,
        stages: int,
        feed_forward: bool,
    ) -> None:
        self._dynamics = dynamics = LagDynamics.of(model, period_s, axes)
        self._first, self._feed_forward, m = axes.start, feed_forward, dynamics.axes
        stick = slice(2 * m, 3 * m)
        A, B = dynamics.matrices()
        C, D = np.eye(3 * m), np.eye(3 * m, m, -2 * m)
        C[stick] = 0.0
        W = np.concatenate((weights.position[axes], weights.velocity[axes], weights.effort[axes]))
        self._P_0: Array = np.asarray(
            solve_discrete_are(A, B, C.T @ np.diag(W) @ C, np.diag(W[stick])), dtype=float
        )
        s = np.full(3 * m, weights.soft)
        s[stick] = HARD
        s[:m][np.arange(4)[axes] == YAW] = 0.0
        self._problem = repeated(stages, A, B, C, D, W, s, self._P_0)
        self._problem.s[0, : 2 * m] = 0.0


class AxisProblem(LagProblem):
    """Formulation for one axis."""

    def problem(self, task: CascadeTask, heights: Array | None = None) -> OptimalControlProblem:
        """State the problem of an axis alone; `heights`, shape (2, N), replace the position's bounds."""
        p, dynamics, axis = self._problem, self._dynamics, self._first
        velocity = task.reference[:, X_RATE + axis, None]
        change = np.zeros(velocity.shape)
        if self._feed_forward:
            acceleration = task.reference[:, X_ACCELERATION + axis, None]
            change = (1.0 - dynamics.decay) * velocity + dynamics.period_s * acceleration
        state_following(p, task, dynamics, axis, velocity, change)
        if heights is not None:
            p.low[:, 0], p.high[:, 0] = heights
        return p


@part
def beyond(value: float, lowest: float, highest: float) -> tuple[float, float]:
    """Return by how much a value is below (negative) and above its limits."""
    return min(value - lowest, 0.0), max(value - highest, 0.0)


@compiled(PROBLEM, TASK, LAG_DYNAMICS, COUNT, ANY_MATRIX, MATRIX)
def state_following(
    p: OptimalControlProblem,
    task: CascadeTask,
    dynamics: LagDynamics,
    first: int,
    velocity: Array,
    change: Array,
) -> None:
    """State the problem of the axes from `first` on with a reference of velocities, shape (N + 1, m).

    `change` is how the actuators change them in a period. Sticks u and actuators a that follow from it:

        a_k = change_k / (T b) - load / b,    u_k = (a_{k+1} - pole a_k) / (1 - pole) + gyro v_k
    """
    N, m, T = len(p.r), len(dynamics.gain), dynamics.period_s
    motion, reference, limits = task.estimate.motion, task.reference, task.limits
    for i in range(m):
        axis, speed, stick = first + i, m + i, 2 * m + i
        gain, pole, load = dynamics.gain[i], dynamics.pole[i], task.load[axis]
        slowest, fastest = limits.velocity[0, axis], limits.velocity[1, axis]
        lowest, highest = limits.input_min[axis], limits.input_max[axis]
        below, above = beyond(motion[XD_BODY + axis], slowest, fastest)
        for k in range(N):
            followed = (change[k + 1, i] - pole * change[k, i]) / (T * gain * (1.0 - pole)) - load / gain
            wanted = followed + dynamics.gyro[i] * velocity[k, i]
            p.low[k, i], p.high[k, i] = limits.position[0, axis], limits.position[1, axis]
            p.low[k, speed] = slowest + task.recovery[k] * below
            p.high[k, speed] = fastest + task.recovery[k] * above
            p.low[k, stick], p.high[k, stick] = lowest, highest
            p.r[k, i], p.r[k, speed] = reference[k, axis], velocity[k, i]
            p.r[k, stick] = min(max(wanted, lowest), highest)
            p.c[k, speed] = T * load
        p.x_0[i], p.x_0[speed] = motion[axis], motion[XD_BODY + axis]
        p.x_0[stick] = task.estimate.actuator[axis]
        p.x_end[i], p.x_end[speed] = reference[N, axis], velocity[N, i]
        p.x_end[stick] = change[N, i] / (T * gain) - load / gain
