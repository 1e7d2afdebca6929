"""Whether a measured tilt is the vehicle's: compared with what the positions say it must have been.

A Tracker that mixes up markers of an object, or a gateway that reports every body level, gives a tilt that
does not go with the motion. The tilt that positions and sticks alone let expect is less exact, but the two
swing together where both are of the same vehicle. Only how they swing counts: how the markers sit on the body
shifts the measured one, which says nothing. Limits and arithmetic are those of `rcopterx.native.noise`.
"""

import math

import numpy as np

from rcopterx.control.estimators.noise_meter import NoiseMeter
from rcopterx.native.noise import BEYOND_S, CONCORDANCE, NOISE, TRUST, TRUSTED, judge_tilt
from rcopterx.vehicles.state import Array


class TiltTrust:
    """Judges the measured tilt of one vehicle.

    Attributes
    ----------
    memory, noise_memory
        What is known, and what the meter of the measured tilt's noise knows, for kernels that judge by
        themselves (`rcopterx.native.noise`).
    """

    def __init__(self) -> None:
        self._meter = NoiseMeter(2)
        self.noise_memory = self._meter.memory
        self.memory: Array = np.zeros(TRUST)
        self.memory[TRUSTED] = 1.0
        self.forget()

    def forget(self) -> None:
        """Begin the means anew, as after a start; what was found stays."""
        self.memory[: BEYOND_S + 1] = 0.0
        self.memory[CONCORDANCE] = math.nan

    @property
    def trusted(self) -> bool:
        """Whether the measured tilt is to be used; it is to begin with."""
        return bool(self.memory[TRUSTED])

    @property
    def concordance(self) -> float | None:
        """Of measured and expected tilt; None as long as it cannot be told."""
        found = float(self.memory[CONCORDANCE])
        return None if math.isnan(found) else found

    def observe(self, measured: Array, expected: Array, yaw_rad: float, period_s: float) -> bool:
        """Take in a pose.

        Parameters
        ----------
        measured, expected
            Tilt in the inertial frame, shape (2,).
        yaw_rad
            Heading.
        period_s
            Time since the last one.

        Returns
        -------
        bool
            True if `trusted` has changed.
        """
        return judge_tilt(self.memory, self.noise_memory, measured, expected, yaw_rad, period_s)

    def observe_noise(self, measured: Array, period_s: float) -> None:
        """Take in a pose of a vehicle that stands, where nothing can be compared."""
        self._meter.observe(measured, period_s)
        self.memory[NOISE] = max(self._meter.deviation or (0.0,))
