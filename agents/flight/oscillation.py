"""Detection of oscillations: a stick or the tilt that swings to and fro, again and again.

A half-wave begins when a signal passes its threshold on the other side than before. Half-waves that follow
each other as closely as those of an unstable loop do, 0.6 to 5 Hz, are counted: an oscillation goes on. On
its way to a new place a vehicle accelerates and brakes, and swings for a while; there more are needed.
"""

from typing import Final

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_PITCH, U_ROLL, U_YAW, YAW, Array

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
        self._rest = np.append(model.hover_input[sticks], np.zeros(2))
        reach = np.minimum(model.u_max - model.hover_input, model.hover_input - model.u_min)[sticks]
        tilt = float(model.b[:2].mean()) * float(reach[:2].mean()) / model.gravity_m_s2
        self._threshold = THRESHOLD * np.append(reach, [tilt, tilt])
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        channels = len(self._rest)
        self._side = np.zeros(channels)
        self._since_s = np.zeros(channels)
        self._count = np.zeros(channels, dtype=int)
        self._count_near = np.zeros(channels, dtype=int)

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
        values = np.zeros(len(self._rest))
        values[: len(_STICKS)] = stick[list(_STICKS)]
        if tilt is not None:
            values[len(_STICKS) :] = tilt
        away = values - self._rest
        side = np.sign(away) * (np.abs(away) > self._threshold)
        self._since_s += period_s
        begins = (side != 0.0) & (side != self._side)
        follows = (self._since_s >= SHORTEST_HALF_WAVE_S) & (self._since_s <= LONGEST_HALF_WAVE_S)
        # The first one follows nothing.
        self._count[begins] = np.where(follows & (self._side != 0.0), self._count + 1, 1)[begins]
        near = float(np.linalg.norm(error[:YAW])) < NEAR_M and abs(float(error[YAW])) < NEAR_RAD
        self._count_near[begins] = np.minimum(self._count_near + 1, self._count)[begins]
        self._side[begins], self._since_s[begins] = side[begins], 0.0
        over = self._since_s > LONGEST_HALF_WAVE_S
        self._count[over] = self._count_near[over] = 0
        if not near:
            self._count_near[:] = 0
        enough = (self._count_near >= HALF_WAVES) | (self._count >= HALF_WAVES_AWAY)
        return bool((begins & enough).any())
