"""When programs do what can wait: in the part of a frame's period in which no command is on its way."""

import math
from typing import Final

BUSY_SHARE: Final = 0.5
"""Of a frame's period from its arrival on: agents compute, and commands travel to the radio."""
LONGEST_PERIOD_S: Final = 0.1
"""Frames that are rarer leave processors and links calm for most of the time."""


def calm_at_s(due_s: float, arrived_s: float | None, period_s: float) -> float:
    """The earliest calm moment from the one on at which something is due.

    Parameters
    ----------
    due_s
        When it is due; minus infinity for what cannot wait.
    arrived_s, period_s
        Arrival and period of any frame; None and 0 before the first.

    Returns
    -------
    float
        At most half a period later, whether further frames have arrived or not.
    """
    if arrived_s is None or due_s == -math.inf or not 0.0 < period_s <= LONGEST_PERIOD_S:
        return due_s
    return due_s + max(0.0, BUSY_SHARE * period_s - (due_s - arrived_s) % period_s)
