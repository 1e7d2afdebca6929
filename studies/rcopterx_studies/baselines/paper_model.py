"""The paper's discrete linear model, cost and scaling, with the readings of its contradictions in one place.

Where the printed paper contradicts itself, rcopterx reads:

1. The affine term is subtracted, x[k+1] = A_d x[k] + B_d u[k] - c_d, as in (2); (4) prints a plus sign.
   c_d = T_s (0 0 0 0 0 0 g 0 k_i x_ref k_i y_ref k_i z_ref).
2. Q is printed with 10 entries for 11 states: Q = diag(8 8 8 4 1 1 1 1 1 1 1), R = diag(5 5 5 1).
3. x_min and x_max are printed with 7 entries: they bound x, y, z, xd_B, yd_B, zd_B, psid (`BOUNDED_STATES`);
   psi and the integral states are free.
4. Bounds and the scaling D differ for xd_B (1 and 1.1) and psid (2.5 and 25): the bounds constrain, D scales.
5. "ms" in the units of D is metre-seconds, the unit of the integral states.
6. P is the solution of the discrete algebraic Riccati equation for (A_d, B_d, Q, R).
7. The rotation of (6) is printed transposed for the angle it names. References here are in the inertial frame
   and body velocities are R(psi_ref)' v, which a leader flying along +x_I at any heading satisfies.
8. The input reference is hover thrust and zeros else.
"""

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Final

import msgspec
import numpy as np
from scipy.linalg import solve_discrete_are

from rcopterx.control.controllers.settings import PositiveFloat
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import (
    INPUT_SIZE,
    MOTION_SIZE,
    XD_BODY,
    YAW,
    YAW_RATE,
    YD_BODY,
    ZD_BODY,
    Array,
    X,
    Y,
    Z,
)

X_INT: Final = 8
Y_INT: Final = 9
Z_INT: Final = 10
STATE_SIZE: Final = 11
BOUNDED_STATES: Final = (X, Y, Z, XD_BODY, YD_BODY, ZD_BODY, YAW_RATE)
INTEGRAL_STATES: Final = (X_INT, Y_INT, Z_INT)

ElevenWeights = Annotated[tuple[PositiveFloat, ...], msgspec.Meta(min_length=11, max_length=11)]

STATE_WEIGHTS: Final = (8.0, 8.0, 8.0, 4.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
INPUT_WEIGHTS: Final = (5.0, 5.0, 5.0, 1.0)


@dataclass(frozen=True)
class PaperModel:
    """Equation (2) for one vehicle and period."""

    model: Model  # the vehicle
    period_s: float  # T_s
    z_integrator: bool = True  # whether z_int integrates; [11] had none

    @property
    def integrator_gains(self) -> Array:
        """k_i of x, y, z, shape (3,)."""
        gain = self.model.integrator_gain
        return np.array([gain, gain, gain if self.z_integrator else 0.0])

    def dynamics(self, yaw_rad: float) -> Array:
        """A_d(psi), linearised at zero velocity; shape (11, 11)."""
        a = np.zeros((STATE_SIZE, STATE_SIZE))
        c, s = np.cos(yaw_rad), np.sin(yaw_rad)
        a[X, XD_BODY], a[X, YD_BODY] = c, -s
        a[Y, XD_BODY], a[Y, YD_BODY] = s, c
        a[Z, ZD_BODY] = 1.0
        a[YAW, YAW_RATE] = 1.0
        a[range(XD_BODY, MOTION_SIZE), range(XD_BODY, MOTION_SIZE)] = self.model.k
        a[INTEGRAL_STATES, (X, Y, Z)] = self.integrator_gains
        return np.eye(STATE_SIZE) + self.period_s * a

    def input_matrix(self) -> Array:
        """B_d, shape (11, 4)."""
        b = np.zeros((STATE_SIZE, INPUT_SIZE))
        b[range(XD_BODY, MOTION_SIZE), range(INPUT_SIZE)] = self.period_s * self.model.b
        return b

    def affine(self, position_m: Array) -> Array:
        """c_d for a reference position, shape (11,); it is subtracted."""
        c = np.zeros(STATE_SIZE)
        c[ZD_BODY] = self.period_s * self.model.gravity_m_s2
        c[X_INT:] = self.period_s * self.integrator_gains * position_m
        return c


class TerminalCost:
    """P(psi) of equation (3).

    With Q equal in x and y and in x_int and y_int, P(psi) = T(psi)' P(0) T(psi) with T rotating the position
    and integrator pairs into the body frame: one Riccati equation, none in flight. Otherwise the equation is
    solved once per heading and remembered. The weights are diagonals of Q, shape (11,), and R, shape (4,).
    """

    def __init__(self, paper_model: PaperModel, state_weights: Array, input_weights: Array) -> None:
        self._paper_model = paper_model
        self._state_weights = state_weights
        self._input_weights = input_weights
        along, across = state_weights[[[X, X_INT], [Y, Y_INT]]]
        self._isotropic = bool((along == across).all())
        self._solved = cache(self._solve)

    def at(self, yaw_rad: float) -> Array:
        """P at a heading, shape (11, 11)."""
        if not self._isotropic:
            # on a grid, so that a turning reference meets remembered headings again
            return self._solved(round(float(np.remainder(yaw_rad, 2 * np.pi)), 2))
        turn = body_turn(yaw_rad)
        rotated: Array = turn.T @ self._solved(0.0) @ turn
        return rotated

    def gain(self, yaw_rad: float) -> Array:
        """Feedback K of u = u_ref - K (x - x_ref) that belongs to P, shape (4, 11)."""
        a, b, p = self._paper_model.dynamics(yaw_rad), self._paper_model.input_matrix(), self.at(yaw_rad)
        gain = np.linalg.solve(np.diag(self._input_weights) + b.T @ p @ b, b.T @ p @ a)
        return np.asarray(gain, dtype=np.float64)

    def _solve(self, yaw_rad: float) -> Array:
        active = np.arange(STATE_SIZE if self._paper_model.z_integrator else Z_INT)
        cost: Array = np.zeros((STATE_SIZE, STATE_SIZE))
        cost[np.ix_(active, active)] = solve_discrete_are(
            self._paper_model.dynamics(yaw_rad)[np.ix_(active, active)],
            self._paper_model.input_matrix()[active],
            np.diag(self._state_weights[active]),
            np.diag(self._input_weights),
        )
        return cost


def body_turn(yaw_rad: float) -> Array:
    """T(psi): rotates the position and the integrator pair into the body frame, shape (11, 11)."""
    turn = np.eye(STATE_SIZE)
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    for first in (X, X_INT):
        turn[first : first + 2, first : first + 2] = [[c, s], [-s, c]]
    return turn
