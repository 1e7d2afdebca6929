"""The problem of axes whose sticks act through lags (docs/formulas.md): heading, and height.

States are position, velocity and actuator of every axis; rows are position, velocity and stick.
"""

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.controllers.cascade.limits import Task
from rcopterx.control.controllers.cascade.weights import CascadeWeights
from rcopterx.control.models.lags import LagDynamics
from rcopterx.control.solver.problem import HARD, OptimalControlProblem, repeated
from rcopterx.vehicles.state import YAW, Array


class AxisProblem:
    """Formulation for some of the axes x, y, z, yaw with N = `stages` planned inputs.

    With `feed_forward` sticks are referred to those that fly the reference, without to those that keep its
    velocity. The arrays of a problem are used again for the next one.
    """

    def __init__(
        self, axes: slice, dynamics: LagDynamics, weights: CascadeWeights, stages: int, feed_forward: bool
    ) -> None:
        self._axes, self._dynamics, self._feed_forward = axes, dynamics, feed_forward
        m = dynamics.axes
        self._velocity, self._stick = slice(m, 2 * m), slice(2 * m, 3 * m)
        A, B = dynamics.matrices()
        C, D = np.eye(3 * m), np.eye(3 * m, m, -2 * m)
        C[self._stick] = 0.0
        W = np.concatenate((weights.position[axes], weights.velocity[axes], weights.effort[axes]))
        self._P_0: Array = np.asarray(
            solve_discrete_are(A, B, C.T @ np.diag(W) @ C, np.diag(W[self._stick])), dtype=float
        )
        s = np.full(3 * m, weights.soft)
        s[self._stick] = HARD
        s[:m][np.arange(4)[axes] == YAW] = 0.0
        self._problem = repeated(stages, A, B, C, D, W, s, self._P_0)
        self._problem.s[0, : 2 * m] = 0.0

    def problem(self, task: Task, heights: Array | None = None) -> OptimalControlProblem:
        """State the problem of an axis that depends on no other.

        `heights` bounds the position at every stage, shape (2, N), instead of the task's bounds.
        """
        dynamics, axes = self._dynamics, self._axes
        velocity = task.reference[:, 4 + axes.start : 4 + axes.stop]
        change = np.zeros(velocity.shape)
        if self._feed_forward:
            acceleration = task.reference[:, 8 + axes.start : 8 + axes.stop]
            change = velocity + dynamics.period_s * acceleration - dynamics.decay * velocity
        p = self._stated(task, velocity, change)
        if heights is not None:
            p.low[:, 0], p.high[:, 0] = heights
        return p

    def _stated(self, task: Task, velocity: Array, change: Array) -> OptimalControlProblem:
        """Problem with a reference of velocities and their changes per period, shape (N + 1, m)."""
        p, dynamics, axes, bounds = self._problem, self._dynamics, self._axes, task.bounds
        position = slice(0, dynamics.axes)
        load = task.load[axes]
        balance = load / dynamics.gain
        actuators, sticks = dynamics.feed_forward(change, velocity)
        low, high = bounds.stick[:, axes]
        p.low[:, position], p.high[:, position] = bounds.position[:, axes]
        p.low[:, self._velocity], p.high[:, self._velocity] = (
            bounds.lowest_velocity[:, axes],
            bounds.highest_velocity[:, axes],
        )
        p.low[:, self._stick], p.high[:, self._stick] = low, high
        p.r[:, position], p.r[:, self._velocity] = task.reference[:-1, axes], velocity[:-1]
        p.r[:, self._stick] = np.minimum(np.maximum(sticks - balance, low), high)
        p.c[:, self._velocity] = dynamics.period_s * load
        motion = task.estimate.motion
        measured = (motion[axes], motion[4 + axes.start : 4 + axes.stop], task.estimate.actuator[axes])
        p.x_0[:] = np.concatenate(measured)
        p.x_end[:] = np.concatenate((task.reference[-1, axes], velocity[-1], actuators[-1] - balance))
        return p
