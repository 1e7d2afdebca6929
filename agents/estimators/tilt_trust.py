"""Whether a measured tilt is the vehicle's: compared with what the positions say it must have been.

A Tracker that mixes up markers of an object, or a gateway that reports every body level, gives a tilt that
does not go with the motion. The tilt that positions and sticks alone let expect is less exact, but the two
swing together where both are of the same vehicle. Only how they swing counts: how the markers sit on the body
shifts the measured one, which says nothing.
"""

from typing import Final

WINDOW_S: Final = 2.0
"""Time constant of the means."""
LEAST_TILT: Final = 0.008
"""Root mean square of the expected swing below which nothing can be told."""
DISTRUSTED_BELOW: Final = 0.2
TRUSTED_ABOVE: Final = 0.4
"""Concordance: 1 for two tilts that are the same, 0 for two that have nothing to do with each other."""
DISTRUSTED_AFTER_S: Final = 0.5
TRUSTED_AFTER_S: Final = 2.0
"""How long the concordance has to stay beyond its limit."""


class TiltTrust:
    """Judges the measured tilt of one vehicle.

    Attributes
    ----------
    trusted
        Whether the measured tilt is to be used; it is to begin with.
    """

    def __init__(self) -> None:
        self.trusted = True
        self.forget()

    def forget(self) -> None:
        """Begin the means anew, as after a start; what was found stays."""
        self._mean: tuple[float, float, float, float] | None = None
        self._energy = self._expected_energy = self._common = self._noise_energy = 0.0
        self._beyond_s = self._seen_s = 0.0

    @property
    def concordance(self) -> float | None:
        """Of measured and expected tilt; None as long as it cannot be told."""
        if self._seen_s < WINDOW_S or self._expected_energy < LEAST_TILT**2:
            return None
        common, measured = self._common, max(self._energy - self._noise_energy, 0.0)
        concordance = 2.0 * common / (measured + self._expected_energy)
        if common <= 0.0 or measured < LEAST_TILT**2:
            return concordance
        # All that is measured is expected, too; what is expected besides are errors of the expectation.
        return max(concordance, min(common / measured, measured / common))

    def observe(
        self,
        measured: tuple[float, float],
        expected: tuple[float, float],
        period_s: float,
        noise_energy: float = 0.0,
    ) -> bool:
        """Take in a pose.

        Parameters
        ----------
        measured, expected
            Tilt in the heading frame.
        period_s
            Time since the last one.
        noise_energy
            Sum of the variances of the noise of what is measured, which does not count.

        Returns
        -------
        bool
            True if `trusted` has changed.
        """
        # Plain floats: arrays of two take longer than the arithmetic on them.
        now = *measured, *expected
        before = now if self._mean is None else self._mean
        share = min(period_s / WINDOW_S, 1.0)
        mean_x, mean_y, mean_expected_x, mean_expected_y = self._mean = (
            before[0] + share * (now[0] - before[0]),
            before[1] + share * (now[1] - before[1]),
            before[2] + share * (now[2] - before[2]),
            before[3] + share * (now[3] - before[3]),
        )
        x, y = now[0] - mean_x, now[1] - mean_y
        expected_x, expected_y = now[2] - mean_expected_x, now[3] - mean_expected_y
        self._expected_energy += share * (expected_x**2 + expected_y**2 - self._expected_energy)
        self._energy += share * (x**2 + y**2 - self._energy)
        self._noise_energy += share * (noise_energy - self._noise_energy)
        self._common += share * (x * expected_x + y * expected_y - self._common)
        self._seen_s += period_s
        return self._judge(period_s)

    def _judge(self, period_s: float) -> bool:
        found = self.concordance
        if found is None:
            return False
        against = found < DISTRUSTED_BELOW if self.trusted else found > TRUSTED_ABOVE
        self._beyond_s = self._beyond_s + period_s if against else 0.0
        if self._beyond_s < (DISTRUSTED_AFTER_S if self.trusted else TRUSTED_AFTER_S):
            return False
        self.trusted, self._beyond_s = not self.trusted, 0.0
        return True
