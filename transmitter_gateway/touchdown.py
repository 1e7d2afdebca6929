"""Whether a vehicle that comes down stands, from its height, its climb rate and its thrust."""

from __future__ import annotations

from rcopterx.transmitter_gateway.landing import Motion

AT_FLOOR_M = 0.01
STILL_M_S = 0.1
AT_FLOOR_S = 0.2
LIGHT = 0.15
"""With so much less thrust than in hover, a vehicle that does not sink stands on something."""
LIGHT_S = 0.5


class Touchdown:
    """Watches one vehicle on its way down."""

    def __init__(self) -> None:
        self._at_floor_since_s: float | None = None
        self._light_since_s: float | None = None

    def release(self) -> None:
        """Reset: the vehicle is not on its way down."""
        self._at_floor_since_s = self._light_since_s = None

    def happened(self, motion: Motion, floor_m: float, missing_thrust: float, now_s: float) -> bool:
        """Whether the vehicle stands; `floor_m` is its height before it took off, `missing_thrust` hover
        minus applied.
        """
        still = abs(motion.velocity_m_s[2]) < STILL_M_S
        if not (still and motion.position_m[2] < floor_m + AT_FLOOR_M):
            self._at_floor_since_s = None
        elif self._at_floor_since_s is None:
            self._at_floor_since_s = now_s
        if not (still and missing_thrust > LIGHT):
            self._light_since_s = None
        elif self._light_since_s is None:
            self._light_since_s = now_s
        at_floor, light = self._at_floor_since_s, self._light_since_s
        return (at_floor is not None and now_s >= at_floor + AT_FLOOR_S) or (
            light is not None and now_s >= light + LIGHT_S
        )
