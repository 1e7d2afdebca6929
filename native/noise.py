"""Kernels that tell noise from motion, and a vehicle's tilt from another one.

They are of `rcopterx.control.estimators.noise_meter` and `rcopterx.control.estimators.tilt_trust`.
"""

import math

import numpy as np

from rcopterx.compiling.compiled import ANY_VECTOR, NUMBER, VECTOR, Array, compiled, part

WINDOW_S = 2.0
"""Time constant of the means."""
SMALLEST_WINDOW = 25
"""Third differences from which on the noise is told."""
OUTLIER = 4.0
"""A third difference counts at most as so many times the mean one: outliers are no noise."""
REGULAR = 0.2
"""Largest relative difference of periods of regular poses."""
DEVIATION_OF_MEAN = math.sqrt(math.pi / 2.0) / math.sqrt(20.0)
"""Standard deviation of normal noise over the mean size of its third differences (-1, 3, -3, 1)."""

PERIOD_S = 0
KEPT = 1
SEEN = 2
MEANS = 3
"""Where a meter of c channels keeps the period of regular poses, how many of the last four values it has,
how many third differences it has seen, c means of their sizes, and from there on the values, the oldest
first."""
LAST = 4

LEAST_TILT = 0.008
"""Root mean square of the expected swing below which nothing can be told."""
DISTRUSTED_BELOW = 0.2
TRUSTED_ABOVE = 0.4
"""Concordance: 1 for two tilts that are the same, 0 for two that have nothing to do with each other."""
DISTRUSTED_AFTER_S = 0.5
TRUSTED_AFTER_S = 2.0
"""How long the concordance has to stay beyond its limit."""

ENERGY = 4
EXPECTED_ENERGY = 5
COMMON = 6
NOISE_ENERGY = 7
SEEN_S = 8
BEYOND_S = 9
CONCORDANCE = 10
TRUSTED = 11
NOISE = 12
TRUST = 13
"""What a trust knows: means of measured and expected tilt, of their energies and of what both have in common,
of the energy of noise; for how long it has seen both, and how long the concordance has been beyond its limit;
the concordance, nan if it cannot be told; whether the tilt is trusted; the standard deviation of the noise of
the measured tilt's worse component, 0 as long as it cannot be told; and how many entries there are."""


@compiled(VECTOR, ANY_VECTOR, NUMBER)
def observe_noise(memory: Array, values: Array, period_s: float) -> None:
    """Move on the mean size of third differences of what is measured.

    Parameters
    ----------
    memory
        See `MEANS`, changed in place, shape (3 + 5 c,).
    values
        What was measured now, shape (c,).
    period_s
        Time since the last one.
    """
    channels = len(values)
    mean, last = memory[MEANS : MEANS + channels], memory[MEANS + channels :]
    if abs(period_s - memory[PERIOD_S]) > REGULAR * memory[PERIOD_S]:
        memory[KEPT] = 0.0
        memory[PERIOD_S] = period_s
    for place in range((LAST - 1) * channels):
        last[place] = last[place + channels]
    for channel in range(channels):
        last[(LAST - 1) * channels + channel] = values[channel]
    memory[KEPT] = min(memory[KEPT] + 1.0, float(LAST))
    if memory[KEPT] < LAST or not period_s > 0.0:
        return
    memory[SEEN] += 1.0
    share = max(1.0 / memory[SEEN], min(period_s / WINDOW_S, 1.0))
    for channel in range(channels):
        first, second, third, fourth = (
            last[channel],
            last[channels + channel],
            last[2 * channels + channel],
            last[3 * channels + channel],
        )
        size = abs(fourth - first + 3.0 * (second - third))
        if memory[SEEN] > SMALLEST_WINDOW:
            size = min(size, OUTLIER * mean[channel])
        mean[channel] += share * (size - mean[channel])


@compiled(VECTOR, ANY_VECTOR, NUMBER, VECTOR, VECTOR)
def measure_noise(memory: Array, pose: Array, period_s: float, least: Array, variance: Array) -> None:
    """Measure the noise of positions and headings.

    Parameters
    ----------
    memory, pose, period_s
        See `observe_noise`.
    least
        Standard deviations, at least, shape (4,).
    variance
        Set to the variances as soon as they can be told, those of the worst axis for all positions, shape
        (4,).
    """
    observe_noise(memory, pose, period_s)
    if memory[SEEN] < SMALLEST_WINDOW:
        return
    noise_m = least[0]
    for axis in range(3):
        noise_m = max(noise_m, DEVIATION_OF_MEAN * memory[MEANS + axis])
    noise_rad = max(least[3], DEVIATION_OF_MEAN * memory[MEANS + 3])
    for axis in range(4):
        variance[axis] = noise_m * noise_m if axis < 3 else noise_rad * noise_rad


@part
def concordance(trust: Array) -> float:
    """Concordance of measured and expected tilt; nan as long as it cannot be told."""
    expected = float(trust[EXPECTED_ENERGY])
    if trust[SEEN_S] < WINDOW_S or expected < LEAST_TILT**2:
        return math.nan
    common, measured = float(trust[COMMON]), max(float(trust[ENERGY] - trust[NOISE_ENERGY]), 0.0)
    found = 2.0 * common / (measured + expected)
    if common <= 0.0 or measured < LEAST_TILT**2:
        return found
    # All that is measured is expected, too; what is expected besides are errors of the expectation.
    return max(found, min(common / measured, measured / common))


@compiled(VECTOR, VECTOR, ANY_VECTOR, ANY_VECTOR, NUMBER, NUMBER)
def judge_tilt(
    trust: Array, noise: Array, measured: Array, expected: Array, yaw_rad: float, period_s: float
) -> bool:
    """Compare a measured tilt with the expected one.

    Parameters
    ----------
    trust
        See `TRUST`, changed in place.
    noise
        Memory of the meter of the measured tilt's noise, changed in place.
    measured, expected
        Horizontal components of the axis, inertial frame, shape (2,).
    yaw_rad
        Heading: what counts is how they swing seen from the vehicle.
    period_s
        Time since the last one.

    Returns
    -------
    bool
        Whether it is trusted now and was not, or the other way round.
    """
    observe_noise(noise, measured, period_s)
    noise_x = noise_y = 0.0
    if noise[SEEN] >= SMALLEST_WINDOW:
        noise_x, noise_y = DEVIATION_OF_MEAN * noise[MEANS], DEVIATION_OF_MEAN * noise[MEANS + 1]
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    begun, share = trust[SEEN_S] > 0.0, min(period_s / WINDOW_S, 1.0)
    swing = np.empty(4)
    for place in range(2):
        axis = measured if place == 0 else expected
        swing[2 * place], swing[2 * place + 1] = c * axis[0] + s * axis[1], c * axis[1] - s * axis[0]
    for place in range(4):
        if not begun:
            trust[place] = swing[place]
        trust[place] += share * (swing[place] - trust[place])
        swing[place] -= trust[place]
    trust[ENERGY] += share * (swing[0] ** 2 + swing[1] ** 2 - trust[ENERGY])
    trust[EXPECTED_ENERGY] += share * (swing[2] ** 2 + swing[3] ** 2 - trust[EXPECTED_ENERGY])
    trust[COMMON] += share * (swing[0] * swing[2] + swing[1] * swing[3] - trust[COMMON])
    trust[NOISE_ENERGY] += share * (noise_x * noise_x + noise_y * noise_y - trust[NOISE_ENERGY])
    trust[SEEN_S] += period_s
    trust[CONCORDANCE] = found = concordance(trust)
    trust[NOISE] = max(noise_x, noise_y)
    if not math.isnan(found):
        trusted = trust[TRUSTED] > 0.0
        against = found < DISTRUSTED_BELOW if trusted else found > TRUSTED_ABOVE
        trust[BEYOND_S] = trust[BEYOND_S] + period_s if against else 0.0
        if trust[BEYOND_S] >= (DISTRUSTED_AFTER_S if trusted else TRUSTED_AFTER_S):
            trust[TRUSTED], trust[BEYOND_S] = 1.0 - trust[TRUSTED], 0.0
            return True
    return False
