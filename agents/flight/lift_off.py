"""Lift-off and touchdown.

At lift-off the thrust rises open loop until the vehicle is seen to leave the floor. A model knows neither the
floor nor the thrust that this battery gives today. So the controller takes over only when the vehicle has
left the floor; the thrust that lifted it carries its weight.

Nothing proves before that the pose is that of this vehicle. A vehicle whose weight is `s` times that of its
model and that is not seen reaches, under a thrust that rises at the rate r to the peak p,

    v = g (p - s)^2 / (2 r s),    h = g (p - s)^3 / (6 r^2 s)

so the thrust passes quickly through the range in which vehicles of the type lift, and falls again at once.
"""

import math
from typing import Final

import numpy as np

from rcopterx.control.interfaces import Estimate
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2, INPUT_SIZE, U_THRUST, ZD_BODY, Array, Z

SPOOL_UP_S: Final = 0.4
BASE_SHARE: Final = 0.85  # part of the hover thrust to which the rotor turns up first
SINKING_SHARE: Final = 0.66  # after a peak: a vehicle that has lifted unseen sinks slowly to the floor...
SINKING_S: Final = 0.9  # ...in this time
FALL_PER_S: Final = 8.0  # rate of the thrust after a peak, in hover thrusts
PEAK_SHARE: Final = 1.38  # largest thrust of the rotor, as a share of the hover thrust
RISE_PER_S: Final = 1.8  # rate of the thrust until then, in hover thrusts
NEAR_FLOOR: Final = 1.05  # by how much more the rotors of a coaxial helicopter lift near the floor
PEAK_S: Final = SPOOL_UP_S + (PEAK_SHARE - BASE_SHARE) / RISE_PER_S
TRIES: Final = 5  # a receiver may still search its radio, and a lift may not be seen in time
TRY_S: Final = PEAK_S - SPOOL_UP_S + SINKING_S
LIFTED_M: Final = 0.006  # twenty times the noise of a motion capture
LIFT_SPEED_M_S: Final = 0.05  # speed of the climb of a vehicle that is seen to have lifted


class LiftOff:
    """One take-off, from `begin` to the first lift."""

    def __init__(self, model: Model) -> None:
        self._model = model
        near_floor = NEAR_FLOOR if model.airframe == "coaxial" else 1.0
        self._hover = float(model.hover_input[U_THRUST]) / near_floor
        self._largest = float(model.u_max[U_THRUST])
        self._begun_s = math.inf
        self._floor_m = 0.0

    @property
    def under_way(self) -> bool:
        """Whether the vehicle stands with its rotor turning up."""
        return self._begun_s < math.inf

    def begin(self, time_s: float, floor_m: float) -> None:
        """Begin to turn the rotor up; `floor_m` is the height of the standing vehicle."""
        self._begun_s, self._floor_m = time_s, floor_m

    def pause(self, time_s: float) -> None:
        """Keep the thrust that lifts no vehicle while nothing is seen; then it rises anew."""
        self._begun_s = max(self._begun_s, time_s - SPOOL_UP_S)

    def end(self) -> None:
        """End the lift-off: the vehicle flies, or the take-off was given up."""
        self._begun_s = math.inf

    def thrust(self, time_s: float) -> float:
        """Return the thrust input to command now; it leads the rotor's lag. 0 while nothing is under way."""
        share, slope_per_s = _share(_in_try(time_s - self._begun_s))
        commanded = self._hover * (share + self._model.lag_s[U_THRUST] * slope_per_s)
        return min(max(commanded, 0.0), self._largest)

    def estimate(self, motion: Array, time_s: float) -> Estimate:
        """Return the estimate after lift-off from `motion`, shape (8,).

        The thrust that carries the weight is that of the moment when the vehicle left the floor.
        """
        climbing = motion.copy()
        climbing[ZD_BODY] = LIFT_SPEED_M_S
        actuator, disturbance = np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE)
        actuator[U_THRUST] = self._hover * _share(self._acts_s(time_s))[0]
        weight = self._model.b[U_THRUST] * self.carrying_thrust(time_s)
        disturbance[U_THRUST] = self._model.gravity_m_s2 - weight
        return Estimate(climbing, actuator, disturbance)

    def carrying_thrust(self, time_s: float) -> float:
        """Return the thrust under which a vehicle left the floor that is seen to have lifted now."""
        rising_s = (6 * LIFTED_M / (RISE_PER_S * GRAVITY_M_S2)) ** (1 / 3)
        return self._hover * _share(self._acts_s(time_s) - rising_s)[0]

    def _acts_s(self, time_s: float) -> float:
        """Time in a try whose thrust acts now, at its peak at the latest."""
        return min(_in_try(time_s - self._model.delay_s - self._begun_s), PEAK_S)

    def lifted(self, height_m: float) -> bool:
        """Whether the vehicle has left the floor."""
        return self.under_way and height_m > self._floor_m + LIFTED_M

    def failed(self, time_s: float) -> bool:
        """Whether it has not lifted, and has sunk to the floor if it did so unseen."""
        return time_s > self._begun_s + SPOOL_UP_S + TRIES * TRY_S


def _in_try(elapsed_s: float) -> float:
    """Time since the beginning of a lift-off as if it were in its first try."""
    return elapsed_s if elapsed_s < PEAK_S else SPOOL_UP_S + (elapsed_s - SPOOL_UP_S) % TRY_S


def _share(elapsed_s: float) -> tuple[float, float]:
    """Thrust of the rotor at a time of a lift-off, as a share of the hover thrust, and its slope [1/s]."""
    if elapsed_s < 0.0:
        return 0.0, 0.0
    if elapsed_s < SPOOL_UP_S:
        return BASE_SHARE * elapsed_s / SPOOL_UP_S, BASE_SHARE / SPOOL_UP_S
    if elapsed_s <= PEAK_S:
        return BASE_SHARE + RISE_PER_S * (elapsed_s - SPOOL_UP_S), RISE_PER_S
    falling = PEAK_SHARE - FALL_PER_S * (elapsed_s - PEAK_S)
    return (falling, -FALL_PER_S) if falling > SINKING_SHARE else (SINKING_SHARE, 0.0)


FLOOR_TOLERANCE_M: Final = 0.03
BELOW_FLOOR_M: Final = 0.1  # at floor height, with its reference so far below it, a vehicle stands there
STUCK_DEPTH_M: Final = 0.2  # a landing vehicle that stays so far above its reference stands on something
FLOOR_SPEED_M_S: Final = 0.1
FLOOR_TIME_S: Final = 0.2


class Touchdown:
    """Watches one vehicle."""

    def __init__(self) -> None:
        self.floor_m = 0.0  # height of the vehicle before its take-off; 0 after a restart in flight
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
