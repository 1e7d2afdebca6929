"""Noise of what a Tracker measures, told from the motion by third differences.

The acceleration of a vehicle hardly changes within a few frames, noise does. So the third difference of poses
that follow each other regularly is noise, and nothing has to be known of the vehicle.
"""

import math
from collections import deque
from typing import Final

import numpy as np

from rcopterx.native.noise import update_noise_mean
from rcopterx.vehicles.state import Array

WINDOW_S: Final = 2.0
"""Time constant of the mean."""
SMALLEST_WINDOW: Final = 25
"""Third differences from which on the noise is told."""
OUTLIER: Final = 4.0
"""A third difference counts at most as so many times the mean one: outliers are no noise."""
_DIFFERENCE: Final = np.array([-1.0, 3.0, -3.0, 1.0])
_NEEDED: Final = len(_DIFFERENCE)
_DEVIATION_OF_MEAN: Final = math.sqrt(math.pi / 2) / float(np.linalg.norm(_DIFFERENCE))
"""Standard deviation of normal noise over the mean size of its third differences."""
_REGULAR: Final = 0.2
"""Largest relative difference of periods of regular poses."""


class NoiseMeter:
    """Measures the standard deviation of the noise of some channels.

    Parameters
    ----------
    channels
        How many.
    """

    def __init__(self, channels: int) -> None:
        self._last: deque[Array] = deque(maxlen=_NEEDED)
        self._period_s = 0.0
        self._mean: Array = np.zeros(channels)
        self._seen = 0

    @property
    def deviation(self) -> tuple[float, ...] | None:
        """Standard deviation of the noise of each channel; None as long as it cannot be told."""
        if self._seen < SMALLEST_WINDOW:
            return None
        return tuple([_DEVIATION_OF_MEAN * mean for mean in self._mean.tolist()])

    def observe(self, values: Array, period_s: float) -> None:
        """Take in what was measured.

        Parameters
        ----------
        values
            One for each channel; angles are unwrapped.
        period_s
            Time since the last one.
        """
        if abs(period_s - self._period_s) > _REGULAR * self._period_s:
            self._last.clear()
            self._period_s = period_s
        last = self._last
        last.append(values)
        if len(last) < _NEEDED or not period_s > 0.0:
            return
        self._seen += 1
        share = max(1.0 / self._seen, min(period_s / WINDOW_S, 1.0))
        outlier = OUTLIER if self._seen > SMALLEST_WINDOW else math.inf
        first, second, third, fourth = last
        update_noise_mean(first, second, third, fourth, self._mean, outlier, share)
