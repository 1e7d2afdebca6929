"""What a Tracker measures: its noise, and whether its tilt is the vehicle's."""

import cmath
import math
from collections import deque
from typing import Final

from rcopterx.vehicles.state import Array

NOISE_WINDOW_S: Final = 0.5  # time constant of the mean size of third differences
SMALLEST_WINDOW: Final = 25  # third differences before which the noise is unknown
OUTLIER: Final = 4.0  # a third difference counts at most as so many times the mean one: outliers are no noise
REGULAR: Final = 0.2  # largest relative difference of periods of regular poses
DEVIATION_OF_MEAN: Final = math.sqrt(math.pi / 2.0) / math.sqrt(20.0)
"""Standard deviation of normal noise over the mean size of its third differences."""


class NoiseMeter:
    """Measures the standard deviation of the noise of some channels, by third differences.

    The acceleration of a vehicle hardly changes within a few frames, noise does. So the third difference
    (-1, 3, -3, 1) of poses at regular times is noise, without any knowledge of the vehicle.
    """

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
        share = max(1.0 / self._differences, min(period_s / NOISE_WINDOW_S, 1.0))
        for channel, (first, second, third, fourth) in enumerate(zip(*self._last, strict=True)):
            mean = self._mean_size[channel]
            size = abs(fourth - first + 3.0 * (second - third))
            if self._differences > SMALLEST_WINDOW:
                size = min(size, OUTLIER * mean)
            self._mean_size[channel] = mean + share * (size - mean)


TILT_WINDOW_S: Final = 2.0  # time constant of all means
LEAST_TILT: Final = 0.008  # root mean square of the expected swing below which nothing can be compared
DISTRUSTED_BELOW: Final = 0.2
TRUSTED_ABOVE: Final = 0.4  # limits of the concordance
DISTRUSTED_AFTER_S: Final = 0.5
TRUSTED_AFTER_S: Final = 2.0  # how long the concordance has to stay beyond its limit


class TiltTrust:
    """Compares the measured tilt of a vehicle, trusted at first, with that expected by positions and sticks.

    A Tracker that mixes up markers of an object, or a gateway that reports every body level, gives a tilt
    that contradicts the motion. The expected tilt is less exact, but the two swing together where both are of
    the same vehicle. Only how they swing counts: how the markers sit on the body shifts the measured one
    only.
    """

    def __init__(self) -> None:
        self.trusted = True
        self.noise_deviation = 0.0  # of the measured tilt's worse component; 0 while unknown
        self._meter = NoiseMeter(2)
        self.restart()

    def restart(self) -> None:
        """Forget all means, as the vehicle has jumped; `trusted` stays."""
        self.concordance: float | None = None  # 1 for equal tilts, 0 for unrelated ones; None if unknown
        self._observed_s = 0.0
        self._beyond_s = 0.0
        self._mean_measured = self._mean_expected = 0j  # tilts in the body frame as complex numbers
        self._measured_energy = self._expected_energy = self._common_energy = self._noise_energy = 0.0

    def observe(self, measured: Array, expected: Array, yaw_rad: float, period_s: float) -> bool:
        """Compare inertial tilts, shape (2,), measured and expected; return whether `trusted` has changed."""
        noise_energy = self.observe_noise(measured, period_s)
        to_body = cmath.rect(1.0, -yaw_rad)
        in_body, expected_in_body = (
            complex(*measured.tolist()) * to_body,
            complex(*expected.tolist()) * to_body,
        )
        if self._observed_s == 0.0:
            self._mean_measured, self._mean_expected = in_body, expected_in_body
        self._observed_s += period_s
        share = min(period_s / TILT_WINDOW_S, 1.0)
        self._mean_measured += share * (in_body - self._mean_measured)
        self._mean_expected += share * (expected_in_body - self._mean_expected)
        swing, expected_swing = in_body - self._mean_measured, expected_in_body - self._mean_expected
        self._measured_energy += share * (abs(swing) ** 2 - self._measured_energy)
        self._expected_energy += share * (abs(expected_swing) ** 2 - self._expected_energy)
        self._common_energy += share * ((swing * expected_swing.conjugate()).real - self._common_energy)
        self._noise_energy += share * (noise_energy - self._noise_energy)
        self.concordance = self._concordance()
        return self.concordance is not None and self._judge(self.concordance, period_s)

    def observe_noise(self, measured: Array, period_s: float) -> float:
        """Update `noise_deviation`; return the mean square of the noise.

        The tilt of a vehicle that stands shows nothing else.
        """
        self._meter.observe(measured, period_s)
        deviation = self._meter.deviation or (0.0, 0.0)
        self.noise_deviation = max(deviation)
        return deviation[0] ** 2 + deviation[1] ** 2

    def _concordance(self) -> float | None:
        if self._observed_s < TILT_WINDOW_S or self._expected_energy < LEAST_TILT**2:
            return None
        measured, expected = max(self._measured_energy - self._noise_energy, 0.0), self._expected_energy
        common = self._common_energy
        found = 2.0 * common / (measured + expected)
        if common <= 0.0 or measured < LEAST_TILT**2:
            return found
        # If all that is measured is expected, what is expected besides are errors of the expectation.
        return max(found, min(common / measured, measured / common))

    def _judge(self, concordance: float, period_s: float) -> bool:
        against = concordance < DISTRUSTED_BELOW if self.trusted else concordance > TRUSTED_ABOVE
        self._beyond_s = self._beyond_s + period_s if against else 0.0
        if self._beyond_s < (DISTRUSTED_AFTER_S if self.trusted else TRUSTED_AFTER_S):
            return False
        self.trusted, self._beyond_s = not self.trusted, 0.0
        return True
