"""Noise of what a Tracker measures, told from the motion by third differences.

The acceleration of a vehicle hardly changes within a few frames, noise does. So the third difference of poses
that follow each other regularly is noise, and nothing has to be known of the vehicle.
"""

import numpy as np

from rcopterx.native.noise import DEVIATION_OF_MEAN, LAST, MEANS, SEEN, SMALLEST_WINDOW, observe_noise
from rcopterx.vehicles.state import Array


class NoiseMeter:
    """Measures the standard deviation of the noise of some channels.

    Parameters
    ----------
    channels
        How many.

    Attributes
    ----------
    memory
        What is known, for kernels that observe by themselves (`rcopterx.native.noise`).
    """

    def __init__(self, channels: int) -> None:
        self._channels = channels
        self.memory: Array = np.zeros(MEANS + (1 + LAST) * channels)

    @property
    def deviation(self) -> tuple[float, ...] | None:
        """Standard deviation of the noise of each channel; None as long as it cannot be told."""
        if self.memory[SEEN] < SMALLEST_WINDOW:
            return None
        means = self.memory[MEANS : MEANS + self._channels]
        return tuple((DEVIATION_OF_MEAN * means).tolist())

    def observe(self, values: Array, period_s: float) -> None:
        """Take in what was measured.

        Parameters
        ----------
        values
            One for each channel; angles are unwrapped.
        period_s
            Time since the last one.
        """
        observe_noise(self.memory, values, period_s)
