"""The last minute of every vehicle, for trails and plots."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rcopterx.ground_station.scripting.state import VehicleState

Array = NDArray[np.float64]

SAMPLE_S: Final = 0.1
KEPT_S: Final = 60.0
COLUMNS: Final = (
    "x_m", "y_m", "z_m", "reference_x_m", "reference_y_m", "reference_z_m", "error_mm", "solve_ms",
    "pitch", "roll", "thrust", "yaw",
)  # fmt: skip
_UNKNOWN: Final = (math.nan, math.nan, math.nan)


class History:
    """Samples of one vehicle; unknown values are NaN."""

    def __init__(self) -> None:
        self._rows = np.full((round(KEPT_S / SAMPLE_S), 1 + len(COLUMNS)), math.nan)
        self._next = 0
        self._count = 0
        self.newest_s = -math.inf
        """Of the newest sample."""

    def add(self, now_s: float, state: VehicleState, sticks: tuple[float, ...] | None) -> None:
        """Add a sample unless the last one is younger than a sampling period.

        `sticks` are pitch, roll, thrust and yaw as written to the radio, None if unknown.
        """
        if now_s - self.newest_s < SAMPLE_S * 0.9:
            return
        self.newest_s = now_s
        agent, plan = state.agent, state.plan
        place = state.position_m or _UNKNOWN
        flown = plan is not None and plan.airborne and plan.reference is not None
        reference = plan.reference[:3] if flown and plan is not None and plan.reference else _UNKNOWN
        error_mm = math.nan if state.error_m is None else 1000.0 * state.error_m
        solve_ms = math.nan if agent is None else agent.diagnostics.solve_ms_p50
        row = (now_s, *place, *reference, error_mm, solve_ms, *(sticks or 4 * (math.nan,)))
        self._rows[self._next] = row
        self._next = (self._next + 1) % len(self._rows)
        self._count = min(self._count + 1, len(self._rows))

    def column(self, name: str) -> Array:
        """Samples of one quantity of `COLUMNS`, oldest first."""
        return np.asarray(self._ordered()[:, 1 + COLUMNS.index(name)])

    @property
    def times_s(self) -> Array:
        """Times of the samples, oldest first."""
        return np.asarray(self._ordered()[:, 0])

    def trail_m(self, seconds: float) -> Array:
        """Positions of the last seconds, shape (n, 3), without gaps."""
        rows = self._ordered()
        recent = rows[rows[:, 0] >= self.newest_s - seconds][:, 1:4]
        return np.asarray(recent[np.isfinite(recent).all(axis=1)])

    def _ordered(self) -> Array:
        return np.roll(self._rows, -self._next, axis=0)[len(self._rows) - self._count :]
