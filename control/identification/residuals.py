"""Errors of the predictions of a motion that a fit makes small: of the next period, or further ahead."""

from typing import Final

import numpy as np

from rcopterx.control.identification.motions import Motion
from rcopterx.control.models.linear import Complex
from rcopterx.vehicles.state import Array

SETTLE_S: Final = 2.0  # errors count from here on: predictors start without knowledge of the wind
_FAR_AHEAD_S: Final = (0.2, 1.0)
_FAR_EVERY_S: Final = 0.3


def settled(motion: Motion) -> int:
    """Return the row from which on errors count."""
    return round(SETTLE_S / motion.period_s)


def _parts(errors: Complex) -> Array:
    return np.concatenate((errors.real, errors.imag))


def plane_innovations(motion: Motion) -> list[Array]:
    """Both components of the innovations of each measurement."""
    return [_parts(column) for column in motion.innovations()[settled(motion) :].T]


def axis_innovations(motion: Motion) -> list[Array]:
    """Innovations of each measurement of a real motion."""
    return list(motion.innovations()[settled(motion) :].real.T)


def far_plane_errors(motion: Motion) -> list[Array]:
    """Both components of errors further ahead, thinned out; equally many of each distance."""
    return [_parts(errors) for errors in _far_errors(motion)]


def far_axis_errors(motion: Motion) -> list[Array]:
    """The same of a real motion."""
    return [errors.real for errors in _far_errors(motion)]


def _far_errors(motion: Motion) -> list[Complex]:
    rows = slice(settled(motion), None, round(_FAR_EVERY_S / motion.period_s))
    return [motion.errors_ahead(round(ahead_s / motion.period_s), rows) for ahead_s in _FAR_AHEAD_S]
