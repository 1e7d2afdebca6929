"""The flight on which solvers are compared, with the same states for each."""

from dataclasses import dataclass

import numpy as np

from rcopterx.control.controllers.registry import CONTROLLERS
from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.vehicles.model import Model, input_behind_gyro, motion_derivative
from rcopterx.vehicles.state import Array

SET_POINTS = (
    (0.0, 0.0, 1.0, 0.0),
    (0.3, 0.0, 1.4, 0.0),
    (0.3, 0.3, 1.4, np.pi / 2),
    (-0.5, 0.3, 1.4, np.pi / 2),
    (-0.5, 0.3, 1.0, np.pi / 2),
    (0.0, 0.0, 1.2, -np.pi / 2),
    (0.4, -0.4, 1.0, 0.0),
)
"""x, y, z [m], yaw [rad]: hovering, translations, turns, and both at once."""
HOLD_S = 5.0
TURBULENCE = np.array([0.15, 0.15, 0.1, 0.5])
CORRELATION_S = 0.5
POSITION_NOISE_M = 3e-4
YAW_NOISE_RAD = 1e-3
VELOCITY_NOISE_M_S = 3e-3
YAW_RATE_NOISE_RAD_S = 2e-2
SUBSTEPS = 5


@dataclass(frozen=True, slots=True)
class Moment:
    """Inputs of a controller at one step."""

    estimate: Estimate
    set_point: Array
    last_input: Array

    def reference(self, period_s: float, stages: int) -> Trajectory:
        """Set point over a horizon."""
        return hold(self.set_point[:3], float(self.set_point[3]), period_s, stages)


def record_flight(model: Model, period_s: float, steps: int, seed: int) -> list[Moment]:
    """Fly the set points in turbulence with the cascade; returns the controller's inputs of each step."""
    rng = np.random.default_rng(seed)
    pilot = CONTROLLERS.build("cascade", model, period_s, {})
    noise = np.repeat(
        [POSITION_NOISE_M, YAW_NOISE_RAD, VELOCITY_NOISE_M_S, YAW_RATE_NOISE_RAD_S], [3, 1, 3, 1]
    )
    memory = np.exp(-period_s / CORRELATION_S)
    motion, actuator = np.array([0, 0, 1.0, 0, 0, 0, 0, 0]), model.hover_input.copy()
    disturbance, last = np.zeros(4), model.hover_input
    moments = []
    for step in range(steps):
        set_point = np.array(SET_POINTS[int(step * period_s / HOLD_S) % len(SET_POINTS)])
        estimate = Estimate(motion + noise * rng.normal(size=8), actuator.copy(), disturbance.copy())
        if step == 0:
            pilot.reset(estimate, last)
        moments.append(Moment(estimate, set_point, last))
        last = pilot.step(estimate, moments[-1].reference(period_s, pilot.horizon), last).inputs[0]
        disturbance = memory * disturbance + TURBULENCE * np.sqrt(1 - memory**2) * rng.normal(size=4)
        h = period_s / SUBSTEPS
        for _ in range(SUBSTEPS):
            followed = input_behind_gyro(model, motion, actuator, last)
            actuator = followed + (actuator - followed) * np.exp(-h / np.array(model.lag_s))
            motion = motion + h * motion_derivative(model, motion, actuator, disturbance)
    return moments
