"""The process noise of the horizontal motion with a tilt model, which filters and margins share."""

from functools import lru_cache
from typing import Final

import numpy as np

from rcopterx.control.estimators.settings import ExtendedKalmanSettings, noise_of
from rcopterx.control.models.lateral import VELOCITY, WIND_CORRELATION_S, lateral_system
from rcopterx.control.models.linear import noise_over
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

_TRIM_DENSITY: Final = 0.002
_OFFSET_DENSITY: Final = 0.0005
_SERVO_DENSITY: Final = 0.01


@lru_cache(maxsize=256)
def process_noise(model: Model, settings: ExtendedKalmanSettings, period_s: float) -> Array:
    """Return the covariance Q that a period adds, shape (n, n): Van Loan's integral plus random walks."""
    noise, system = noise_of(model, settings), lateral_system(model, period_s)
    size = system.size
    density = np.zeros(size)
    density[VELOCITY] = noise.velocity_noise[0] ** 2
    density[system.tilt_rate] = noise.tilt_density**2
    density[system.wind] = 2.0 * noise.wind_rms_m_s2**2 / WIND_CORRELATION_S
    Q = np.zeros((size + 4, size + 4))
    Q[:size, :size] = noise_over(system.continuous, density, period_s)
    trim, offset = slice(size, size + 2), slice(size + 2, size + 4)
    for states, walk in ((system.servo, _SERVO_DENSITY), (trim, _TRIM_DENSITY), (offset, _OFFSET_DENSITY)):
        Q[states, states] += period_s * walk**2 * np.eye(2)
    return Q
