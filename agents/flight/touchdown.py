"""Whether a vehicle that lands stands on the floor, told by its height, its climb and its reference."""

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
    """Watches one vehicle.

    Attributes
    ----------
    floor_m
        Height at which the vehicle stood before its take-off; an agent that restarted in flight takes 0.
    """

    def __init__(self) -> None:
        self.floor_m = 0.0
        self._since_s: float | None = None

    def begin(self) -> None:
        """Watch a landing from its beginning."""
        self._since_s = None

    def happened(self, motion: Array, reference_m: float, time_s: float) -> bool:
        """Whether the vehicle stands.

        Parameters
        ----------
        motion
            Estimated motion state, shape (8,).
        reference_m
            Height of the landing's reference now.
        time_s
            Present fleet time.
        """
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
