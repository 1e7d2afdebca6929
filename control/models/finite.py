"""Whether an estimate can be computed with."""

from rcopterx.control.interfaces import NO_TILT, Estimate
from rcopterx.native.motion import SOUND, flaw


def flaw_of(estimate: Estimate) -> int:
    """What is to be said of an estimate (`rcopterx.native.motion.flaw`); 0 if nothing is.

    Raises
    ------
    TypeError
        A part is no vector of 64-bit floats.
    """
    tilt = estimate.tilt
    if tilt is None:
        tilt = NO_TILT
    return flaw(
        estimate.motion,
        estimate.actuator,
        estimate.disturbance,
        tilt.core,
        tilt.servo,
        tilt.wind_m_s2,
        tilt.trim,
    )


def is_finite(estimate: Estimate) -> bool:
    """Whether an estimate can be computed with, every number of it being finite."""
    return flaw_of(estimate) == SOUND
