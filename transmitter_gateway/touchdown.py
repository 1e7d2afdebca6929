"""Whether a vehicle that comes down stands, from its height and its climb rate."""

from rcopterx.transmitter_gateway.landing import Motion

AT_FLOOR_M = 0.01
STILL_M_S = 0.1
AT_FLOOR_S = 0.2
STILL_M = 0.02
STILL_S = 3.0
"""A vehicle that has been still for so long, although the law lowers its thrust until it sinks, stands on
something; in the air, none would be still for half of that time."""


class Touchdown:
    """Watches one vehicle on its way down."""

    def __init__(self) -> None:
        self._at_floor_since_s: float | None = None
        self._still_since_s: float | None = None
        self._still_at_m = 0.0

    def release(self) -> None:
        """Reset: the vehicle is not on its way down."""
        self._at_floor_since_s = self._still_since_s = None

    def happened(self, motion: Motion, floor_m: float, now_s: float) -> bool:
        """Whether the vehicle stands; `floor_m` is its height before it took off."""
        height_m = motion.position_m[2]
        slow = abs(motion.velocity_m_s[2]) < STILL_M_S
        if not (slow and height_m < floor_m + AT_FLOOR_M):
            self._at_floor_since_s = None
        elif self._at_floor_since_s is None:
            self._at_floor_since_s = now_s
        if self._still_since_s is None or not slow or abs(height_m - self._still_at_m) > STILL_M:
            self._still_since_s, self._still_at_m = now_s, height_m
        at_floor_s = self._at_floor_since_s
        return (at_floor_s is not None and now_s >= at_floor_s + AT_FLOOR_S) or (
            now_s >= self._still_since_s + STILL_S
        )
