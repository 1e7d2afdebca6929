"""The discrete model (2) of the paper, rolled out under given inputs.

Forward Euler with the mid-interval heading in the kinematics; the actuators follow their inputs with the
exact discrete pole exp(-T_s / lag). Velocities of the resulting trajectory are those that move the positions
from stage to stage, accelerations those that move the velocities, so a vehicle of any type and heading that
flies the trajectory through this same model reproduces it exactly.
"""

import math

import numpy as np

from rcopterx.compiling.compiled import ANY_MATRIX, ANY_VECTOR, NUMBER, compiled
from rcopterx.control.interfaces import Estimate
from rcopterx.control.models.prediction import ESTIMATE, MOTION_MODEL, behind_gyro, derivative
from rcopterx.control.references.columns import COLUMNS, X_ACCELERATION, X_RATE
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.model import Model, MotionModel
from rcopterx.vehicles.state import XD_BODY, YAW, YAW_RATE, YD_BODY, ZD_BODY, Array


def lag_poles(model: Model, period_s: float) -> Array:
    """Return the discrete poles of the actuators, shape (4,); zero for an actuator without lag."""
    lag_s = np.array(model.lag_s)
    return np.where(lag_s > 0, np.exp(-period_s / np.where(lag_s > 0, lag_s, 1.0)), 0.0)


def predict(model: Model, estimate: Estimate, inputs: Array, period_s: float) -> Trajectory:
    """Roll the model out from an estimate, whose disturbance lasts, under N - 1 inputs, to N stages."""
    poles = lag_poles(model, period_s)
    return Trajectory(_roll_out(model.motion_model, estimate, inputs, poles, period_s), period_s)


@compiled(MOTION_MODEL, ESTIMATE, ANY_MATRIX, ANY_VECTOR, NUMBER)
def _roll_out(model: MotionModel, estimate: Estimate, inputs: Array, poles: Array, period_s: float) -> Array:
    """Samples of the trajectory, shape (N, 12)."""
    stages = len(inputs) + 1
    motion, actuator = estimate.motion.copy(), estimate.actuator.copy()
    disturbance = estimate.disturbance.copy()
    samples = np.empty((stages, COLUMNS))
    velocity = np.zeros(4)
    for stage in range(stages + 1):
        middle_rad = motion[YAW] + 0.5 * period_s * motion[YAW_RATE]
        c, s = math.cos(middle_rad), math.sin(middle_rad)
        before = velocity.copy()
        velocity[0] = c * motion[XD_BODY] - s * motion[YD_BODY]
        velocity[1] = s * motion[XD_BODY] + c * motion[YD_BODY]
        velocity[2], velocity[3] = motion[ZD_BODY], motion[YAW_RATE]
        if stage > 0:
            for axis in range(4):
                samples[stage - 1, X_ACCELERATION + axis] = (velocity[axis] - before[axis]) / period_s
        if stage == stages:
            break
        rates = derivative(model, motion, actuator, disturbance)
        # The last input lasts.
        followed = behind_gyro(model, inputs[min(stage, stages - 2)], actuator, motion[YAW_RATE])
        for axis in range(4):
            samples[stage, axis], samples[stage, X_RATE + axis] = motion[axis], velocity[axis]
            actuator[axis] = poles[axis] * actuator[axis] + (1.0 - poles[axis]) * followed[axis]
            motion[axis] += period_s * velocity[axis]
            motion[XD_BODY + axis] += period_s * rates[XD_BODY + axis]
    return samples
