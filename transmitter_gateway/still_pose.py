"""A pose that stands still while the thrust rises is not that of the vehicle.

A vehicle in the air whose thrust rises must climb, whatever it weighs. A motion capture that holds a pose,
with noise, or shows a body that stands where the vehicle was, shows no jump and no pose twice, and a
controller that wants to climb would raise the thrust without end.
"""

import math
from collections import deque
from typing import Final

from rcopterx.vehicles.lift_off import AVERAGED_S
from rcopterx.vehicles.state import GRAVITY_M_S2

STILL_M: Final = 0.003  # a mean height so far from the last one has moved
USUAL_S: Final = 1.0  # time constant of the usual thrust, from which more is counted, and of the speed gained
HEAVY_SHARE: Final = 1.15  # thrust that carries a heavy vehicle, as a share of the hover thrust of its model
GAINED_M_S: Final = 0.4  # speed that it may have gained unseen
LONGEST_STEP_S: Final = 0.1


class StillPose:
    """Watches the height of a vehicle in the air."""

    def __init__(self) -> None:
        self._newest: deque[tuple[float, float]] = deque()  # times and heights in the mean
        self.begin()

    def begin(self) -> None:
        """Begin: the vehicle stands, is not seen, or has not proved its lift-off."""
        self._newest.clear()
        self._moved_m = self._usual = math.nan
        self._gained_m_s = 0.0

    @property
    def unanswered(self) -> bool:
        """Whether the pose has not answered the thrust."""
        return self._gained_m_s > GAINED_M_S

    @property
    def doubtful(self) -> bool:
        """Whether the pose stands under a thrust that would lift a heavy vehicle."""
        return self._gained_m_s > 0.0

    def own(self, height_m: float, share: float, now_s: float) -> None:
        """Use the height of a pose; `share` is the thrust that acts, over that at which the model hovers."""
        if not self._newest:
            self._moved_m, self._usual = height_m, share
        elapsed_s = min(now_s - self._newest[-1][0], LONGEST_STEP_S) if self._newest else 0.0
        self._newest.append((now_s, height_m))
        while self._newest[0][0] < now_s - AVERAGED_S:
            self._newest.popleft()
        mean_m = math.fsum(height_m for _, height_m in self._newest) / len(self._newest)
        if abs(mean_m - self._moved_m) > STILL_M:
            self._moved_m, self._usual, self._gained_m_s = mean_m, share, 0.0
        fading = math.exp(-elapsed_s / USUAL_S)
        self._usual = share + fading * (self._usual - share)
        excess = share - max(self._usual, HEAVY_SHARE)
        self._gained_m_s = max(fading * self._gained_m_s + GRAVITY_M_S2 * excess * elapsed_s, 0.0)
