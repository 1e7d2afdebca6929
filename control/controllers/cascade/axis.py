"""The problem of one axis that depends on no other: heading, and height (docs/formulas.md).

States are position, velocity and, with a lag, actuator; rows are position, velocity and stick.
"""

import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.controllers.cascade.lags import LagDynamics
from rcopterx.control.controllers.cascade.limits import PlanLimits, recovery
from rcopterx.control.controllers.cascade.weights import CascadeWeights
from rcopterx.control.interfaces import Estimate
from rcopterx.control.solver.problem import HARD, OptimalControlProblem
from rcopterx.vehicles.state import YAW, Array


class AxisProblem:
    """Formulation for one of the axes x, y, z, yaw with N = `stages` planned inputs."""

    def __init__(self, axis: int, dynamics: LagDynamics, weights: CascadeWeights, stages: int) -> None:
        self._axis, self._dynamics, self._stages = axis, dynamics, stages
        self._axes = slice(axis, axis + 1)
        n = dynamics.states
        A, B = dynamics.matrices()
        C, D = np.zeros((3, n)), np.zeros((3, 1))
        C[0, 0] = C[1, 1] = D[2, 0] = 1.0
        W = np.array((weights.position[axis], weights.velocity[axis], weights.effort[axis]))
        Q = C.T @ np.diag((*W[:2], 0.0)) @ C
        self._A, self._B = np.tile(A, (stages, 1, 1)), np.tile(B, (stages, 1, 1))
        self._C, self._D = np.tile(C, (stages, 1, 1)), np.tile(D, (stages, 1, 1))
        self._W = np.tile(W, (stages, 1))
        self._P: Array = np.ascontiguousarray(solve_discrete_are(A, B, Q, W[2:, None]))
        position = 0.0 if axis == YAW else weights.soft
        self._s = np.tile((position, weights.soft, HARD), (stages, 1))
        self._s[0, :2] = 0.0
        self._recovery = recovery(dynamics.period_s, stages)

    def problem(
        self,
        estimate: Estimate,
        load: float,
        reference: Array,
        limits: PlanLimits,
        heights: Array | None = None,
        feed_forward: bool = True,
    ) -> OptimalControlProblem:
        """State the problem.

        Parameters
        ----------
        load
            Acceleration that acts at every stage and that the stick balances.
        reference
            Samples, shape (N + 1, 12).
        heights
            Bounds of the position at every stage, shape (2, N), instead of those of `limits`.
        feed_forward
            Refer sticks to those that fly the reference, instead of those that keep its velocity.
        """
        axis, dynamics, N = self._axis, self._dynamics, self._stages
        position, velocity, acceleration = reference[:, axis], reference[:, 4 + axis], reference[:, 8 + axis]
        balance = load / dynamics.gain
        change = np.zeros((N + 1, 1))
        if feed_forward:
            change[:, 0] = velocity + dynamics.period_s * acceleration - dynamics.decay * velocity
        actuators, sticks = dynamics.feed_forward(change, velocity[:, None])
        low, high = np.empty((N, 3)), np.empty((N, 3))
        low[:, 0], high[:, 0] = limits.position[:, axis] if heights is None else heights
        measured = estimate.motion[4 + axis : 5 + axis]
        low[:, 1:2], high[:, 1:2] = limits.velocities(self._axes, measured, self._recovery)
        low[:, 2:], high[:, 2:] = limits.sticks(self._axes, balance)
        r = np.column_stack(
            (position[:-1], velocity[:-1], np.clip(sticks - balance, low[:, 2:], high[:, 2:]))
        )
        c = np.zeros((N, dynamics.states))
        c[:, 1] = dynamics.period_s * load
        x_0 = np.array((estimate.motion[axis], estimate.motion[4 + axis], estimate.actuator[axis]))
        x_end = np.array((position[-1], velocity[-1], (actuators[-1] - balance)[0]))
        n = dynamics.states
        return OptimalControlProblem(
            self._A, self._B, c, self._C, self._D, self._W, r, low, high, self._s, self._P, x_end[:n], x_0[:n]
        )
