"""Detection of the touchdown of a landing vehicle by height, climb and reference."""

from typing import Final

from rcopterx.vehicles.state import ZD_BODY, Array, Z

FLOOR_TOLERANCE_M: Final = 0.03
BELOW_FLOOR_M: Final = 0.1
"""A vehicle at the height of the floor whose reference is so far below it stands there."""
STUCK_DEPTH_M: Final = 0.2
"""A landing vehicle that stays so far above its reference stands on something."""
FLOOR_SPEED_M_S: Final = 0.1
FLOOR_TIME_S: Final = 0.2


class Touchdown:
    """Watches one vehicle."""

    def __init__(self) -> None:
        self.floor_m = 0.0
        """Height of the vehicle before its take-off; 0 for an agent that restarted in flight."""
        self._since_s: float | None = None

    def begin(self) -> None:
        """Watch a landing from its beginning."""
        self._since_s = None

    def happened(self, motion: Array, reference_m: float, time_s: float) -> bool:
        """Return whether the vehicle stands, by its motion, shape (8,), and the height of its reference."""
        height_m = float(motion[Z])
        at_floor = abs(height_m - self.floor_m) < FLOOR_TOLERANCE_M
        if at_floor and reference_m < self.floor_m - BELOW_FLOOR_M:
            # Pushed against a floor that its model does not know, a vehicle may bounce and never be slow.
            return True
        low = height_m < self.floor_m + FLOOR_TOLERANCE_M or height_m > reference_m + STUCK_DEPTH_M
        if not low or abs(motion[ZD_BODY]) >= FLOOR_SPEED_M_S:
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = time_s
        return time_s - self._since_s >= FLOOR_TIME_S
