"""Hover thrust: the calibrated one, corrected from steady flight.

A descent is open loop. With an error of eight per cent in the thrust gain, which any battery may cause, a
vehicle touches down at 2 m/s, or hovers until its motors are cut.
"""

from rcopterx.transmitter_gateway.surveillance import Track

FILTER_S = 1.0
CALIBRATION_S = 0.2
"""Steady flight of this time counts as much as the calibration; there may be no more before it is needed."""
STEADY_M_S = 0.1
"""Vertical speed up to which a vehicle counts as hovering."""
PLAUSIBLE = 1.5
"""Thrust further than this times the largest correction from the calibrated one is not that of a hover."""
SEEN_WITHIN_S = 0.1
LONGEST_STEP_S = 0.04


class HoverThrust:
    """Mean of the thrust in steady flight, at first of all of it, then a low-pass.

    It stays within `largest_correction` of the calibrated thrust; above `airborne_m` a vehicle certainly
    flies.
    """

    def __init__(self, calibrated: float, largest_correction: float, airborne_m: float) -> None:
        self._calibrated, self._largest_correction = calibrated, largest_correction
        self._lower, self._upper = calibrated - largest_correction, calibrated + largest_correction
        self._airborne_m = airborne_m
        self._steady_s = 0.0
        self.value = calibrated

    def note(
        self, thrust: float, elapsed_s: float, track: Track | None, floor_m: float, now_s: float
    ) -> None:
        """Use the thrust applied for `elapsed_s` up to `now_s`, if the vehicle hovers; it stands at
        `floor_m`.
        """
        if track is None or track.position_m is None or now_s > track.seen_s + SEEN_WITHIN_S:
            return
        if abs(thrust - self._calibrated) > PLAUSIBLE * self._largest_correction:
            return
        if track.position_m[2] < floor_m + self._airborne_m or abs(track.velocity_m_s[2]) > STEADY_M_S:
            return
        step_s = min(elapsed_s, LONGEST_STEP_S)
        self._steady_s += step_s
        weight = step_s / min(FILTER_S, CALIBRATION_S + self._steady_s)
        self.value = min(max(self.value + weight * (thrust - self.value), self._lower), self._upper)
