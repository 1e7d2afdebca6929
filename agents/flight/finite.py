"""Whether an estimate can be computed with."""

from typing import Final

import numpy as np

from rcopterx.agents.interfaces import Estimate, TiltEstimate
from rcopterx.native.motion import all_finite

NO_TILT: Final = TiltEstimate(*4 * [np.empty(0)])


def is_finite(estimate: Estimate) -> bool:
    """Whether every number of an estimate is finite; all of them are 64-bit floats."""
    tilt = NO_TILT if estimate.tilt is None else estimate.tilt
    return all_finite(
        estimate.motion,
        estimate.actuator,
        estimate.disturbance,
        tilt.core,
        tilt.servo,
        tilt.wind_m_s2,
        tilt.trim,
    )
