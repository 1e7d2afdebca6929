"""Excites a flying vehicle within limits."""

from typing import Final

import numpy as np

from rcopterx.control.identification.excitation import Excitation
from rcopterx.vehicles.state import Array

LONGEST_BLIND_S: Final = 0.1
"""The excitation ends without poses for longer than this."""
UNDER_WAY: Final = "under way"
DONE: Final = "done"


class Exciter:
    """Adds an excitation to the commands of a controller."""

    def __init__(self) -> None:
        self.outcome = ""
        """Why the last excitation ended; `under way` or `done`; empty before the first."""
        self.under_way = False
        self._excitation: Excitation | None = None
        self._start_s = 0.0
        self._place_m: Array = np.zeros(3)
        self._reach_m = 0.0

    def begin(self, excitation: Excitation, place_m: Array, reach_m: float, time_s: float) -> None:
        """Start an excitation in a box of half-width `reach_m` around a place, inertial, shape (3,)."""
        self._excitation, self._start_s, self.under_way = excitation, time_s, True
        self._place_m, self._reach_m = place_m.copy(), reach_m
        self.outcome = UNDER_WAY

    def end(self, outcome: str) -> None:
        """End the present excitation, if there is one, for a reason."""
        if self._excitation is not None:
            self._excitation, self.outcome, self.under_way = None, outcome, False

    def left_s(self, time_s: float) -> float:
        """Return the remaining time of the excitation; 0 without one."""
        if self._excitation is None:
            return 0.0
        return max(0.0, self._start_s + self._excitation.duration_s - time_s)

    def watch(self, time_s: float, position_m: Array, blind_s: float, flying: bool) -> None:
        """End an excitation that is over, or whose limits are exceeded.

        Parameters
        ----------
        position_m
            Position of the vehicle, shape (3,).
        blind_s
            Time since its last pose.
        flying
            Whether it flies freely, neither taking off nor landing.
        """
        if self._excitation is None:
            return
        away_m = np.abs(position_m - self._place_m)
        if not flying:
            self.end("the vehicle does not fly freely any more")
        elif blind_s > LONGEST_BLIND_S:
            self.end(f"no pose for {blind_s:.2f} s")
        elif away_m.max() > self._reach_m:
            self.end(f"{away_m.max():.2f} m from its place, at most {self._reach_m:g} m are allowed")
        elif self.left_s(time_s) == 0.0:
            self.end(DONE)

    def added(self, inputs: Array, time_s: float, period_s: float) -> Array:
        """Return inputs of the coming periods, shape (k, 4), with the excitation added."""
        excitation = self._excitation
        if excitation is None:
            return inputs
        since_s = time_s - self._start_s
        rows = [excitation.at(since_s + row * period_s) for row in range(len(inputs))]
        return np.asarray(inputs + np.array(rows))
