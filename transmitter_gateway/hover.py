"""Hover thrust: the calibrated one, corrected by the motion that the vehicle is seen in.

A descent without poses is open loop. With an error of eight per cent in the thrust gain, which any battery
may cause, a vehicle touches down at 2 m/s, or hovers until its motors are cut.

In the air, a vehicle accelerates upwards by as much of its weight as its thrust exceeds that of a hover. So
the mean thrust of any time, over one plus the mean acceleration in units of the weight, is the hover thrust:
the vehicle need neither hover nor fly steadily.
"""

import math

from rcopterx.transmitter_gateway.landing import RESPONSE_S

FILTER_S = 1.0
PRIOR_S = 0.2  # flight time that counts as much as the first value
PRIOR_DOUBT = 0.15  # error of the first value, as a share of it, that a descent without poses allows for
LEAST = 0.3  # smallest load over weight, and hover thrust over the calibrated one
SETTLING_S = 0.15  # until the low-pass of the climb rate has forgotten the time when the vehicle was not seen
LONGEST_STEP_S = 0.1  # the climb rate after a longer pause says nothing about the thrust


class HoverThrust:
    """Mean over the flight so far, at first of all of it, then a low-pass.

    `gain_m_s2` is the vertical acceleration per thrust of a vehicle that hovers as calibrated. `climb_m_s` is
    the climb rate, predicted while a vehicle that flew is not seen.
    """

    def __init__(self, calibrated: float, largest_correction: float, gain_m_s2: float) -> None:
        self._calibrated = calibrated
        self._lower = max(calibrated - largest_correction, LEAST * calibrated)
        self._upper = min(calibrated + largest_correction, 1.0)
        self._weight_m_s2 = gain_m_s2 * calibrated
        self.begin(calibrated, 0.0)

    def begin(self, first: float, acting: float) -> None:
        """Begin a flight while a thrust acts; `first` counts as `PRIOR_S` of flight at that hover thrust."""
        self._mean_thrust, self._acting = first, acting
        self._mean_m_s2 = 0.0
        self._known_s = 0.0
        self._seen_s = 0.0
        self.climb_m_s = 0.0

    @property
    def value(self) -> float:
        """Thrust at which the vehicle hovers, within `largest_correction` of the calibrated one."""
        load = max(1.0 + self._mean_m_s2 / self._weight_m_s2, LEAST)
        return min(max(self._mean_thrust / load, self._lower), self._upper)

    @property
    def scale(self) -> float:
        """Thrust that this vehicle needs for an acceleration, over that of one that hovers as calibrated."""
        return self.value / self._calibrated

    def below(self, share: float) -> float:
        """Thrust that surely sinks: less than `value` by a share of it, and by its doubt."""
        doubt = PRIOR_DOUBT * PRIOR_S / (PRIOR_S + self._known_s)
        return self.value * (1.0 - share - doubt)

    def note(self, thrust: float, elapsed_s: float, climb_m_s: float | None) -> None:
        """Use the thrust applied for `elapsed_s` and the climb rate after it, None if not seen in the air.

        Updates the means, over the flight and at most `FILTER_S`, of the thrust T after a low-pass with
        `RESPONSE_S`, and of the acceleration a from climb rates: `value` is mean(T) / (1 + mean(a) / g).
        """
        self._acting -= math.expm1(-elapsed_s / RESPONSE_S) * (thrust - self._acting)
        self._seen_s += elapsed_s
        if climb_m_s is None:
            self._seen_s = 0.0
            if self._known_s > 0.0:
                self.climb_m_s += self._weight_m_s2 * (self._acting / self.value - 1.0) * elapsed_s
            return
        before_m_s, self.climb_m_s = self.climb_m_s, climb_m_s
        if self._seen_s <= SETTLING_S or elapsed_s > LONGEST_STEP_S:
            return
        self._known_s += elapsed_s
        filter_s = min(FILTER_S, PRIOR_S + self._known_s)
        self._mean_thrust += (self._acting - self._mean_thrust) * elapsed_s / filter_s
        self._mean_m_s2 += (climb_m_s - before_m_s - self._mean_m_s2 * elapsed_s) / filter_s
