"""Numbers whose last bits are zero, so that flight logs hold them in few bytes.

They are rounded before they are used, not only before they are sent: what is recorded is what was flown.
"""

from collections.abc import Iterable
from math import floor
from time import monotonic
from typing import Final

TIME_BITS: Final = 20
"""Times are told to 2^-20 s, a little less than a microsecond."""
PULSE_BITS: Final = 4
"""Pulse widths are told to a sixteenth of a microsecond, finer than radios resolve."""
_TICKS: Final = 2.0**TIME_BITS


def monotonic_s() -> float:
    """Monotonic clock [s], not finer than times are told."""
    return floor(monotonic() * _TICKS) / _TICKS


def rounded(value: float, bits: int) -> float:
    """Nearest multiple of 2^-bits."""
    unit = 2.0**bits
    return round(value * unit) / unit


def all_rounded(values: Iterable[float], bits: int) -> tuple[float, ...]:
    """Nearest multiples of 2^-bits."""
    unit = 2.0**bits
    return tuple([round(value * unit) / unit for value in values])
