"""The discrete model (2) of the paper, rolled out under given inputs.

Forward Euler with the mid-interval heading in the kinematics; the actuators follow their inputs with the
exact discrete pole exp(-T_s / lag). Velocities of the resulting trajectory are those that move the positions
from stage to stage, accelerations those that move the velocities, so a vehicle of any type and heading that
flies the trajectory through this same model reproduces it exactly.
"""

import numpy as np

from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.trajectory import COLUMNS, Trajectory
from rcopterx.native.cascade import first_order
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import (
    U_PITCH,
    U_ROLL,
    U_THRUST,
    U_YAW,
    XD_BODY,
    YAW,
    YAW_RATE,
    YD_BODY,
    ZD_BODY,
    Array,
)


def lag_poles(model: Model, period_s: float) -> Array:
    """Discrete poles of the actuators, shape (4,); zero for an actuator without lag."""
    lag_s = np.array(model.lag_s)
    return np.where(lag_s > 0, np.exp(-period_s / np.where(lag_s > 0, lag_s, 1.0)), 0.0)


def one_stage_on(inputs: Array) -> Array:
    """Planned inputs after one control period, shape (N - 1, 4): the last one lasts."""
    return np.vstack((inputs[1:], inputs[-1:]))


def predict(model: Model, estimate: Estimate, inputs: Array, period_s: float) -> Trajectory:
    """Roll the nonlinear discrete model out from an estimate.

    Parameters
    ----------
    model
        The vehicle.
    estimate
        Where it starts; its disturbance is taken to last.
    inputs
        Shape (N - 1, 4).
    period_s
        Time between stages.

    Returns
    -------
    Trajectory
        N stages.
    """
    motion, disturbance, k = estimate.motion, estimate.disturbance, model.k
    poles = lag_poles(model, period_s)
    coast = np.vstack((inputs, inputs[-1:]))
    actuator = np.column_stack(
        [first_order(p, s, (1 - p) * u) for p, s, u in zip(poles, estimate.actuator, coast.T, strict=True)]
    )
    push = period_s * (model.b * actuator + disturbance)
    if model.yaw_behind_rotors:
        yaw_rate = _yaw_behind_rotors(model, estimate, coast, actuator[:-1, U_THRUST], period_s)
    else:
        yaw_rate = first_order(1 + period_s * k[U_YAW], motion[YAW_RATE], push[:, U_YAW])
    climb = push[:, U_THRUST] - period_s * model.gravity_m_s2
    vertical = first_order(1 + period_s * k[U_THRUST], motion[ZD_BODY], climb)
    yaw = motion[YAW] + period_s * np.concatenate(([0.0], np.cumsum(yaw_rate)))
    turn = period_s * yaw_rate
    decay_x, decay_y = 1 + period_s * k[U_PITCH], 1 + period_s * k[U_ROLL]
    xd, yd = float(motion[XD_BODY]), float(motion[YD_BODY])
    body = np.empty((len(inputs) + 2, 2))
    steps = zip(turn.tolist(), push[:, U_PITCH].tolist(), push[:, U_ROLL].tolist(), strict=False)
    for i, (w, push_x, push_y) in zip(range(len(body)), steps, strict=False):
        body[i] = xd, yd
        xd, yd = decay_x * xd + w * yd + push_x, decay_y * yd - w * xd + push_y
    return trajectory_from_body(motion, yaw, yaw_rate, body, vertical, period_s, len(inputs) + 1)


def _yaw_behind_rotors(
    model: Model, estimate: Estimate, inputs: Array, thrust_actuator: Array, period_s: float
) -> Array:
    """Yaw rates under sticks and what gyro and thrust make of them, one more than inputs."""
    pole = float(lag_poles(model, period_s)[U_YAW])
    gain, gyro, disturbance = model.input_gain[U_YAW], model.rate_feedback[U_YAW], estimate.disturbance[U_YAW]
    rate, actuator = float(estimate.motion[YAW_RATE]), float(estimate.actuator[U_YAW])
    rates = [rate]
    sticks = inputs[:, U_YAW] + model.thrust_coupling * (inputs[:, U_THRUST] - thrust_actuator)
    for stick in sticks.tolist():
        torque = stick - gyro * rate
        rate += period_s * (gain * actuator + float(disturbance))
        actuator = pole * actuator + (1.0 - pole) * torque
        rates.append(rate)
    return np.array(rates)


def trajectory_from_body(
    motion: Array,
    yaw: Array,
    yaw_rate: Array,
    body_velocity: Array,
    vertical: Array,
    period_s: float,
    stages: int,
) -> Trajectory:
    """Assemble a trajectory from velocities at N + 1 stages.

    Parameters
    ----------
    motion
        Motion state of the first stage, shape (8,).
    yaw, yaw_rate, body_velocity, vertical
        At least N + 1 stages; `body_velocity` has shape (.., 2).
    period_s
        Time between stages.
    stages
        N.

    Returns
    -------
    Trajectory
        N stages whose differences are exactly its velocities and accelerations.
    """
    count = stages + 1
    middle = yaw[:count] + 0.5 * period_s * yaw_rate[:count]
    c, s = np.cos(middle), np.sin(middle)
    velocity = np.column_stack(
        (
            c * body_velocity[:count, 0] - s * body_velocity[:count, 1],
            s * body_velocity[:count, 0] + c * body_velocity[:count, 1],
            vertical[:count],
            yaw_rate[:count],
        )
    )
    samples = np.empty((stages, COLUMNS))
    samples[0, :4] = motion[:4]
    samples[1:, :4] = motion[:4] + period_s * np.cumsum(velocity[: stages - 1], axis=0)
    samples[:, 4:8] = velocity[:stages]
    samples[:, 8:] = np.diff(velocity, axis=0) / period_s
    return Trajectory(samples, period_s)
