"""The last minute of every vehicle, for trails and plots."""

import math
from collections import deque
from typing import Final

import numpy as np

from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.vehicles.state import Array

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
        self._rows: deque[tuple[float, ...]] = deque(maxlen=round(KEPT_S / SAMPLE_S))
        """Time and quantities of each sample."""
        self.newest_s = -math.inf  # of the newest sample

    def add(self, now_s: float, state: VehicleState, sticks: tuple[float, ...] | None) -> None:
        """Add a sample unless one was added a moment ago; `sticks` as written to the radio, or None."""
        if now_s - self.newest_s < SAMPLE_S * 0.9:
            return
        self.newest_s = now_s
        agent, plan = state.agent, state.plan
        place = state.position_m or _UNKNOWN
        flown = plan.reference if plan is not None and plan.airborne else None
        reference = _UNKNOWN if flown is None else flown[:3]
        error_mm = math.nan if state.error_m is None else 1000.0 * state.error_m
        solve_ms = math.nan if agent is None else agent.diagnostics.solve_ms_p50
        self._rows.append((now_s, *place, *reference, error_mm, solve_ms, *(sticks or 4 * (math.nan,))))

    def column(self, name: str) -> Array:
        """Samples of one quantity of `COLUMNS`, oldest first."""
        at = 1 + COLUMNS.index(name)
        return np.array([row[at] for row in self._rows])

    @property
    def times_s(self) -> Array:
        """Times of the samples, oldest first."""
        return np.array([time_s for time_s, *_ in self._rows])

    def trail_m(self, seconds: float) -> Array:
        """Positions of the last seconds, shape (n, 3), without gaps."""
        from_s = self.newest_s - seconds
        recent = np.array([row[1:4] for row in self._rows if row[0] >= from_s]).reshape(-1, 3)
        return np.asarray(recent[np.isfinite(recent).all(axis=1)])
