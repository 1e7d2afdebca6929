"""First afternoon: an LQR of one's own.

`FeedbackController` applies u = hover + trim - K error; an error is motion minus reference: x, y, z, yaw, and
their velocities, with x and y along the body axes. Write `gain`.
"""

import numpy as np

from rcopterx.control.controllers.feedback import FeedbackController
from rcopterx.control.controllers.settings import ControllerSettings


def gain(model, period_s):
    """K, shape (4, 8).

    Your answer: state A and B of the motion over a period, choose Q and R, and solve the discrete algebraic
    Riccati equation (`scipy.linalg.solve_discrete_are`). `model.b` are the accelerations per unit of a stick,
    `model.lag_s` the lags of the sticks. Here is a law that is too soft.
    """
    stiffness, damping = np.array((2.5, 2.5, 3.5, 4.0)), np.array((2.3, 2.3, 3.0, 4.0))
    return np.hstack((np.diag(stiffness), np.diag(damping))) / model.b[:, None]


class OwnLqr(FeedbackController):
    """State feedback without integral action."""

    Settings = ControllerSettings

    def __init__(self, model, period_s, settings):
        integral_gain, error_cap = np.zeros(3), np.array((0.5, 0.5, 0.5, 1.2, 9.0, 9.0, 9.0, 9.0))
        super().__init__(model, period_s, settings, gain(model, period_s), integral_gain, error_cap)
