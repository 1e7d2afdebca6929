"""Bumpless transfer: another controller or estimator takes over without a step of the inputs."""

from typing import Final

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

FADING_TIME_S: Final = 0.09
"""Time constant of the decay of the difference that another controller or estimator makes."""
END: Final = 1e-3
"""Difference that counts as none."""


class BumplessTransfer:
    """Lets the first difference of the inputs after a change fade away."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._pending = False
        self._difference: Array | None = None

    def begin(self) -> None:
        """Begin a transfer: the next inputs come from another controller or estimator."""
        self._pending = True

    def smoothed(self, inputs: Array, last_input: Array, period_s: float) -> Array:
        """Return the inputs of this period and the next ones, shape (k, 4), with the rest of the difference.

        `last_input` is the input of the last period, shape (4,); the result is within the limits.
        """
        if self._pending:
            self._pending = False
            self._difference = last_input - inputs[0]
        if self._difference is None:
            return inputs
        ages_s = period_s * np.arange(1, len(inputs) + 1)
        fading: Array = self._difference * np.exp(-ages_s / FADING_TIME_S)[:, None]
        self._difference = fading[0] if np.abs(fading[0]).max() > END else None
        return np.clip(inputs + fading, self._model.u_min, self._model.u_max)
