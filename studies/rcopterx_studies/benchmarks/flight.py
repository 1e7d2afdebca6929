"""The flight on which solvers are compared: recorded once, then every solver gets the same states."""

from dataclasses import dataclass

import numpy as np

from rcopterx.control.interfaces import Estimate, at_rest
from rcopterx.control.models.prediction import predict
from rcopterx.control.plugins import CONTROLLERS
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import MOTION_SIZE, Array, Z

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
NOISE = np.array([3e-4, 3e-4, 3e-4, 1e-3, 3e-3, 3e-3, 3e-3, 2e-2])
"""Standard deviations of the estimated motion state, m and rad, m/s and rad/s."""


@dataclass(frozen=True, slots=True)
class Moment:
    """Input of a controller in one step."""

    estimate: Estimate
    set_point: Array
    last_input: Array

    def reference(self, period_s: float, stages: int) -> Trajectory:
        """Set point over a horizon."""
        return hold(self.set_point[:3], float(self.set_point[3]), period_s, stages)


def record_flight(model: Model, period_s: float, steps: int, seed: int) -> list[Moment]:
    """Fly the set points in turbulence with the default controller and return its input in every step.

    The vehicle flies as its model predicts; `seed` is of turbulence and noise.
    """
    rng = np.random.default_rng(seed)
    controller = CONTROLLERS.build("cascade", model, period_s, {})
    memory = np.exp(-period_s / CORRELATION_S)
    present, last = at_rest(model)._replace(motion=np.eye(MOTION_SIZE)[Z]), model.hover_input
    moments = []
    for step in range(steps):
        set_point = np.array(SET_POINTS[int(step * period_s / HOLD_S) % len(SET_POINTS)])
        estimate = present._replace(motion=present.motion + NOISE * rng.normal(size=8))
        if step == 0:
            controller.reset(estimate, last)
        moments.append(Moment(estimate, set_point, last))
        reference = moments[-1].reference(period_s, controller.horizon)
        last = controller.step(estimate, reference, last).inputs[0]
        gust = TURBULENCE * np.sqrt(1 - memory**2) * rng.normal(size=4)
        present = present._replace(disturbance=memory * present.disturbance + gust)
        if present.has_tilt:
            wind = present.tilt.wind_m_s2 + gust[:2]
            present = present._replace(tilt=present.tilt._replace(wind_m_s2=wind))
        present = predict(model, present, last, period_s)
    return moments
