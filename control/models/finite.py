"""Estimates as arguments of kernels, and checks before anything is computed with them."""

import math
from typing import Any, Final

from rcopterx.compiling.compiled import ANY_VECTOR, compiled, record
from rcopterx.control.interfaces import Estimate, TiltEstimate
from rcopterx.vehicles.state import INPUT_SIZE, MOTION_SIZE

TILT_ESTIMATE: Final[Any] = record(TiltEstimate, *4 * [ANY_VECTOR])
ESTIMATE: Final[Any] = record(Estimate, *3 * [ANY_VECTOR], TILT_ESTIMATE)


@compiled(ESTIMATE)
def is_finite(estimate: Estimate) -> bool:
    """Whether all numbers of an estimate are finite."""
    motion, actuator, disturbance, tilt = estimate
    core, servo, wind, trim = tilt
    for numbers in (motion, actuator, disturbance, core, servo, wind, trim):
        for number in numbers:
            if not math.isfinite(number):
                return False
    return True


def flaw_of(estimate: Estimate) -> str | None:
    """Return why an estimate is unusable; None if it is usable."""
    try:
        sizes = *map(len, estimate[:3]), *map(len, estimate.tilt[1:])
        if sizes == (MOTION_SIZE, INPUT_SIZE, INPUT_SIZE, *3 * [2 if estimate.has_tilt else 0]):
            return None if is_finite(estimate) else "the estimate is not finite"
    except TypeError:  # no vectors, or vectors of other numbers
        pass
    return "the estimate has another shape than a vehicle's, or other numbers than 64-bit floats"
