"""Statistics of measured series for reports."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def percentiles(values: Sequence[float]) -> dict[str, float] | None:
    """p50, p99 and maximum, rounded to a microsecond if these are milliseconds; None without values."""
    if not len(values):
        return None
    array = np.asarray(values)
    p50, p99 = np.percentile(array, [50, 99])
    return {"p50": round(float(p50), 3), "p99": round(float(p99), 3), "max": round(float(array.max()), 3)}


def rms_and_max(errors_m: NDArray[np.float64]) -> dict[str, float] | None:
    """Root mean square and maximum in millimetres of error norms in metres; None without errors."""
    if not len(errors_m):
        return None
    return {
        "rms": round(1000 * float(np.sqrt(np.mean(errors_m**2))), 2),
        "max": round(1000 * float(errors_m.max()), 2),
    }
