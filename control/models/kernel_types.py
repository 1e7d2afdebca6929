"""Types of the records that kernels of several modules take as arguments."""

from typing import Any, Final

from rcopterx.compiling.compiled import ANY_VECTOR, record
from rcopterx.control.interfaces import Estimate, TiltEstimate

TILT_ESTIMATE: Final[Any] = record(TiltEstimate, *4 * [ANY_VECTOR])
ESTIMATE: Final[Any] = record(Estimate, *3 * [ANY_VECTOR], TILT_ESTIMATE)
