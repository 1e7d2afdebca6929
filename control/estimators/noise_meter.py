"""The noise of what a Tracker measures, separated from the motion by third differences.

The acceleration of a vehicle hardly changes within a few frames, noise does. So the third difference
(-1, 3, -3, 1) of poses at regular times is noise, without any knowledge of the vehicle.
"""

import math
from collections import deque
from typing import Final

from rcopterx.vehicles.state import Array

WINDOW_S: Final = 0.5  # time constant of the mean size of third differences
SMALLEST_WINDOW: Final = 25  # third differences before which the noise is unknown
OUTLIER: Final = 4.0  # a third difference counts at most as so many times the mean one: outliers are no noise
REGULAR: Final = 0.2  # largest relative difference of periods of regular poses
DEVIATION_OF_MEAN: Final = math.sqrt(math.pi / 2.0) / math.sqrt(20.0)
"""Standard deviation of normal noise over the mean size of its third differences."""


class NoiseMeter:
    """Measures the standard deviation of the noise of some channels."""

    def __init__(self, channels: int) -> None:
        self._period_s = 0.0
        self._last: deque[list[float]] = deque(maxlen=4)
        self._differences = 0
        self._mean_size = [0.0] * channels

    @property
    def deviation(self) -> list[float] | None:
        """Standard deviation of the noise of each channel; None while it is unknown."""
        if self._differences < SMALLEST_WINDOW:
            return None
        return [DEVIATION_OF_MEAN * size for size in self._mean_size]

    def observe(self, values: Array, period_s: float) -> None:
        """Observe one measured value of each channel (angles unwrapped), `period_s` after the last ones."""
        if abs(period_s - self._period_s) > REGULAR * self._period_s:
            self._last.clear()
            self._period_s = period_s
        self._last.append(values.tolist())
        if len(self._last) < 4 or not period_s > 0.0:
            return
        self._differences += 1
        share = max(1.0 / self._differences, min(period_s / WINDOW_S, 1.0))
        for channel, (first, second, third, fourth) in enumerate(zip(*self._last, strict=True)):
            mean = self._mean_size[channel]
            size = abs(fourth - first + 3.0 * (second - third))
            if self._differences > SMALLEST_WINDOW:
                size = min(size, OUTLIER * mean)
            self._mean_size[channel] = mean + share * (size - mean)
