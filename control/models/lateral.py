"""The horizontal motion of a vehicle with a tilt model, as one linear system in the inertial frame.

    state   position, velocity, core (`rcopterx.vehicles.tilt`), servo [m/s^2], wind      two components each
    input   demand e = R(psi) b (stick + trim)                                   [m/s^2]

Nothing in it depends on the heading except the direction of the demand, so its matrices are computed once.
The drag is the mean of the two body axes; the wind, an acceleration by drag, also makes the rotors flap.

A vehicle is predicted with sticks instead of demands: its *lateral state* has the servo's stick in place of
the servo's demand, and the trim after the wind. Both turn with the body.
"""

import math
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import ANY_VECTOR, COUNT, MATRIX, NUMBER, compiled, record
from rcopterx.control.interfaces import TiltEstimate
from rcopterx.control.models.linear import zero_order_hold
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

POSITION: Final = slice(0, 2)
VELOCITY: Final = slice(2, 4)
CORE_FROM: Final = 4
WIND_CORRELATION_S: Final = 0.5  # correlation time of the wind's acceleration
_LEAST_DRAG_PER_S: Final = 0.2


class LateralStep(NamedTuple):
    """Parameters of one period for kernels."""

    transition: Array  # state and demand after a period of constant demand, shape (n + 2, n + 2)
    servo: int  # place of the servo
    pitch_gain: float  # demand per stick [m/s^2]
    roll_gain: float


LATERAL_STEP: Final[Any] = record(LateralStep, MATRIX, COUNT, NUMBER, NUMBER)


@compiled(LATERAL_STEP, *2 * [ANY_VECTOR], NUMBER)
def predict_lateral(step: LateralStep, x: Array, stick: Array, yaw_rad: float) -> tuple[Array, Array]:
    """Return the lateral state after a period, and its derivative F by the one before.

    Further states in `x` last. `stick` is (2,), `yaw_rad` the heading in the middle of the period.
    """
    size, trim = len(x), len(step.transition) - 2
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    F = np.zeros((size, size))
    for row in range(size):
        F[row, row] = 1.0
    for row in range(trim):
        for column in range(trim + 2):
            F[row, column] = step.transition[row, column]
        if row < step.servo:
            # What is inertial answers a demand: the stick times its gain, turned by the heading.
            for column in (step.servo, trim):
                along, across = F[row, column], F[row, column + 1]
                F[row, column] = step.pitch_gain * (c * along + s * across)
                F[row, column + 1] = step.roll_gain * (c * across - s * along)
    after = x.copy()
    for row in range(trim):
        after[row] = F[row, trim] * stick[0] + F[row, trim + 1] * stick[1]
        for column in range(trim + 2):
            after[row] += F[row, column] * x[column]
    return after, F


class LateralSystem:
    """Continuous dynamics, and discrete matrices for one period during which the demand is constant.

    `continuous` and `continuous_demand`: x' = continuous x + continuous_demand e, shapes (n, n) and (n, 2).
    `transition` and `demand`: x+ = transition x + demand e; `step`: the same for `predict_lateral`.
    `core`, `tilt`, `tilt_rate`, `servo`, `wind` and `trim`: places of these states; tilt and tilt rate are
    part of the core, and only lateral states have a trim. Raises `ValueError`: the model has no tilt model.
    """

    def __init__(self, model: Model, period_s: float) -> None:
        if model.tilt is None:
            raise ValueError(f"{model.kind}: a first-order lag has no tilt to predict")
        dynamics = model.tilt.dynamics()
        # speed of the wind over the acceleration that it causes by drag
        gust_speed_s = 2.0 / max(-sum(model.damping[:2]), _LEAST_DRAG_PER_S)
        self.core = slice(CORE_FROM, CORE_FROM + dynamics.size)
        self.tilt = slice(CORE_FROM, CORE_FROM + 2)
        self.tilt_rate = slice(CORE_FROM + dynamics.rate.start, CORE_FROM + dynamics.rate.stop)
        self.servo = slice(self.core.stop, self.core.stop + 2)
        self.wind = slice(self.servo.stop, self.servo.stop + 2)
        self.size = self.wind.stop
        self.trim = slice(self.size, self.size + 2)
        self.continuous: Array = np.zeros((self.size, self.size))
        self.continuous[POSITION, VELOCITY] = np.eye(2)
        self.continuous[VELOCITY, VELOCITY] = 0.5 * sum(model.damping[:2]) * np.eye(2)
        self.continuous[VELOCITY, self.core] = dynamics.c
        self.continuous[VELOCITY, self.servo] = dynamics.d
        self.continuous[VELOCITY, self.wind] = np.eye(2)
        self.continuous[self.tilt_rate, VELOCITY] = -dynamics.flapping * np.eye(2)
        self.continuous[self.tilt_rate, self.wind] = dynamics.flapping * gust_speed_s * np.eye(2)
        self.continuous[self.core, self.core] = dynamics.a
        self.continuous[self.core, self.servo] = dynamics.b
        self.continuous[self.servo, self.servo] = -np.eye(2) / model.tilt.servo_lag_s
        self.continuous[self.wind, self.wind] = -np.eye(2) / WIND_CORRELATION_S
        self.continuous_demand: Array = np.zeros((self.size, 2))
        self.continuous_demand[self.servo] = np.eye(2) / model.tilt.servo_lag_s
        self.transition, self.demand = zero_order_hold(self.continuous, self.continuous_demand, period_s)
        held = np.eye(self.size + 2)
        held[: self.size] = np.hstack((self.transition, self.demand))
        self.step = LateralStep(held, self.servo.start, *model.input_gain[:2])

    def tilt_estimate(self, x: Array) -> TiltEstimate:
        """Return the tilt in a lateral state."""
        return TiltEstimate(x[self.core], x[self.servo], x[self.wind], x[self.trim])


lateral_system: Final = lru_cache(maxsize=256)(LateralSystem)
"""Return the system of a model and a period, from a cache."""
