"""Another controller or estimator takes over without a bump of the sticks."""

from typing import Final

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

FADING_TIME_S: Final = 0.09
"""Time constant with which the difference fades that another controller or estimator makes to the input."""
END: Final = 1e-3
"""A difference this small is dropped."""


class BumplessTransfer:
    """Lets the first difference that a change makes to the input fade away.

    Parameters
    ----------
    model
        The vehicle, whose limits are kept.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._pending = False
        self._difference: Array | None = None

    def begin(self) -> None:
        """The next inputs come from another controller or estimator."""
        self._pending = True

    def smoothed(self, inputs: Array, last_input: Array, period_s: float) -> Array:
        """Inputs with what is left of the difference.

        Parameters
        ----------
        inputs
            Of this period and the following ones, shape (k, 4).
        last_input
            Input of the last period, shape (4,).
        period_s
            Time between the inputs.

        Returns
        -------
        Array
            Shape (k, 4), within the limits.
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
