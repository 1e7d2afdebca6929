"""Kernel of the noise meter (`rcopterx.agents.estimators.noise_meter`)."""

import math

import numpy as np

from rcopterx.native.compiled import ANY_VECTOR, NUMBER, Array, compiled


@compiled(*5 * [ANY_VECTOR], NUMBER, NUMBER)
def noise_mean(
    first: Array, second: Array, third: Array, fourth: Array, mean: Array, outlier: float, share: float
) -> Array:
    """Moving mean of the size of third differences of what was measured four times, shape (c,).

    Parameters
    ----------
    mean
        The mean before.
    outlier
        A size counts at most as so many times the mean.
    share
        Of the new size in the mean.
    """
    result = np.empty(len(mean))
    for channel in range(len(mean)):
        size = abs(fourth[channel] - first[channel] + 3.0 * (second[channel] - third[channel]))
        size = min(size, outlier * mean[channel]) if math.isfinite(outlier) else size
        result[channel] = mean[channel] + share * (size - mean[channel])
    return result
