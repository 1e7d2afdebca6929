"""Whether a measured tilt is the vehicle's: compared with what the positions say it must have been.

A Tracker that mixes up markers of an object, or a gateway that reports every body level, gives a tilt that
does not go with the motion. The tilt that positions and sticks alone let expect is less exact, but the two
swing together where both are of the same vehicle. Only how they swing counts: how the markers sit on the body
shifts the measured one, which says nothing. Limits and arithmetic are those of `rcopterx.native.noise`.
"""

import math

import numpy as np

from rcopterx.agents.estimators.noise_meter import NoiseMeter
from rcopterx.native.noise import BEYOND_S, CONCORDANCE, TRUST, TRUSTED, judge_tilt
from rcopterx.vehicles.state import Array


class TiltTrust:
    """Judges the measured tilt of one vehicle.

    Attributes
    ----------
    trusted
        Whether the measured tilt is to be used; it is to begin with.
    noise
        Standard deviation of the noise of the measured tilt's worse component; 0 before it is known.
    """

    def __init__(self) -> None:
        self.trusted = True
        self.noise = 0.0
        self._meter = NoiseMeter(2)
        self._memory: Array = np.zeros(TRUST)
        self.forget()

    def forget(self) -> None:
        """Begin the means anew, as after a start; what was found stays."""
        self._memory[: BEYOND_S + 1] = 0.0
        self._memory[CONCORDANCE], self._memory[TRUSTED] = math.nan, self.trusted

    @property
    def concordance(self) -> float | None:
        """Of measured and expected tilt; None as long as it cannot be told."""
        found = float(self._memory[CONCORDANCE])
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
        self.noise = judge_tilt(self._memory, self._meter.memory, measured, expected, yaw_rad, period_s)
        before, self.trusted = self.trusted, bool(self._memory[TRUSTED])
        return self.trusted != before

    def observe_noise(self, measured: Array, period_s: float) -> None:
        """Take in a pose of a vehicle that stands, where nothing can be compared."""
        self._meter.observe(measured, period_s)
        self.noise = max(self._meter.deviation or (0.0,))
