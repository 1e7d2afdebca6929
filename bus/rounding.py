"""Numbers with few bits, for small flight logs, rounded before use: the log holds what was flown."""

from collections.abc import Iterable
from typing import Final

TIME_BITS: Final = 20  # times are multiples of 2^-20 s, a little less than a microsecond
PULSE_BITS: Final = 4  # pulse widths are multiples of a sixteenth of a microsecond, finer than radios resolve


def rounded(value: float, bits: int) -> float:
    """Return the nearest multiple of 2^-bits."""
    unit = 2.0**bits
    return round(value * unit) / unit


def all_rounded(values: Iterable[float], bits: int) -> tuple[float, ...]:
    """Return the nearest multiples of 2^-bits."""
    return tuple([rounded(value, bits) for value in values])
