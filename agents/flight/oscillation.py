"""Detection of oscillations: a stick or the tilt that swings to and fro, again and again.

A half-wave begins when a signal passes its threshold on the other side than before. Half-waves that follow
each other as closely as those of an unstable loop do, 0.6 to 5 Hz, are counted: an oscillation goes on. On
its way to a new place a vehicle accelerates and brakes, and swings for a while; there more are needed.
"""

import math
from typing import Final

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_PITCH, U_ROLL, U_YAW, Array

SHORTEST_HALF_WAVE_S: Final = 0.1
LONGEST_HALF_WAVE_S: Final = 0.8
THRESHOLD: Final = 0.5
"""Share of a stick's range to either side of rest, and of the largest tilt, that counts."""
HALF_WAVES: Final = 6
"""So many in a row are an oscillation of a vehicle that is near its reference."""
HALF_WAVES_AWAY: Final = 16
"""The same anywhere."""
NEAR_M: Final = 0.4
NEAR_RAD: Final = 0.8
"""Distance from the reference that is near."""

_STICKS: Final = (U_PITCH, U_ROLL, U_YAW)


class OscillationDetector:
    """Counts half-waves of the pitch, roll and yaw sticks and of the tilt of one vehicle.

    Parameters
    ----------
    model
        The vehicle, for what its sticks and its tilt can reach.
    """

    def __init__(self, model: Model) -> None:
        sticks = list(_STICKS)
        reach = np.minimum(model.u_max - model.hover_input, model.hover_input - model.u_min)[sticks]
        tilt = float(model.b[:2].mean()) * float(reach[:2].mean()) / model.gravity_m_s2
        rest = [*model.hover_input[sticks].tolist(), 0.0, 0.0]
        threshold = [THRESHOLD * largest for largest in (*reach.tolist(), tilt, tilt)]
        self._channels = [_Channel(*pair) for pair in zip(rest, threshold, strict=True)]

    def forget(self) -> None:
        """Begin anew."""
        for channel in self._channels:
            channel.forget()

    def observe(self, stick: Array, tilt: Array | None, error: Array, period_s: float) -> bool:
        """Take in a control period.

        Parameters
        ----------
        stick
            Command, shape (4,).
        tilt
            Estimated horizontal components of the body's upward axis, shape (2,); None where not known.
        error
            Deviation from the reference: x, y, z [m], yaw [rad], shape (4,).
        period_s
            Time since the last one.

        Returns
        -------
        bool
            True in a period in which an oscillation begins another half-wave.
        """
        sticks: list[float] = stick.tolist()
        axis = (0.0, 0.0) if tilt is None else tilt.tolist()
        values = [*(sticks[number] for number in _STICKS), *axis]
        x, y, z, yaw_rad = error.tolist()
        near = math.hypot(x, y, z) < NEAR_M and abs(yaw_rad) < NEAR_RAD
        # All of them, also after one that oscillates.
        found = [
            channel.observe(value, near, period_s)
            for channel, value in zip(self._channels, values, strict=True)
        ]
        return any(found)


class _Channel:
    """Half-waves of one signal, in plain floats because arrays of five take longer than the arithmetic."""

    def __init__(self, rest: float, threshold: float) -> None:
        self._rest, self._threshold = rest, threshold
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._side = self._count = self._count_near = 0
        self._since_s = 0.0

    def observe(self, value: float, near: bool, period_s: float) -> bool:
        """Take in a control period; True if an oscillation begins another half-wave."""
        away = value - self._rest
        self._since_s += period_s
        side = 0 if not abs(away) > self._threshold else 1 if away > 0.0 else -1
        begins = side not in (0, self._side)
        if begins:
            # The first one follows nothing.
            follows = self._side != 0 and SHORTEST_HALF_WAVE_S <= self._since_s <= LONGEST_HALF_WAVE_S
            self._count = self._count + 1 if follows else 1
            self._count_near = min(self._count_near + 1, self._count)
            self._side, self._since_s = side, 0.0
        if self._since_s > LONGEST_HALF_WAVE_S:
            self._count = self._count_near = 0
        if not near:
            self._count_near = 0
        return begins and (self._count_near >= HALF_WAVES or self._count >= HALF_WAVES_AWAY)
