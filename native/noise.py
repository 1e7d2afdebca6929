"""Kernel of the noise meter (`rcopterx.agents.estimators.noise_meter`)."""

import math

from rcopterx.native.compiled import ANY_VECTOR, NUMBER, VECTOR, Array, compiled


@compiled(*4 * [ANY_VECTOR], VECTOR, NUMBER, NUMBER)
def update_noise_mean(
    first: Array, second: Array, third: Array, fourth: Array, mean: Array, outlier: float, share: float
) -> None:
    """Move on the mean size of third differences of what was measured four times.

    Parameters
    ----------
    first, second, third, fourth
        Measured, shape (c,).
    mean
        The mean, changed in place, shape (c,).
    outlier
        A size counts at most as so many times the mean.
    share
        Of the new size in the mean.
    """
    for channel in range(len(mean)):
        size = abs(fourth[channel] - first[channel] + 3.0 * (second[channel] - third[channel]))
        size = min(size, outlier * mean[channel]) if math.isfinite(outlier) else size
        mean[channel] += share * (size - mean[channel])
