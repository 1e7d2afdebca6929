"""Lift-off and touchdown.

At lift-off the thrust rises open loop until the vehicle is seen to leave the floor. A model knows neither the
floor nor the thrust that this battery gives today. So the controller takes over only when the vehicle has
left the floor; the thrust that lifted it carries its weight.
"""

import math
from typing import Final

import numpy as np

from rcopterx.control.interfaces import Estimate
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_THRUST, ZD_BODY, Array, Z

SPOOL_UP_S: Final = 0.5
SPOOL_UP_SHARE: Final = 0.85  # part of the hover thrust to which the rotor turns up first
RISE_PER_S: Final = 0.3  # rate of the thrust, in hover thrusts, until the vehicle lifts
LARGEST_SHARE: Final = 1.4  # largest thrust, as a share of the hover thrust
LIFTING_SHARE: Final = 1.1  # from here on the vehicle is expected to lift
PATIENCE_S: Final = 1.5  # how long after that it may stand
LIFTED_M: Final = 0.006  # twenty times the noise of a motion capture
LIFT_SPEED_M_S: Final = 0.05  # speed of the climb of a vehicle that is seen to have lifted


class LiftOff:
    """One take-off, from `begin` to the first lift."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._hover = float(model.hover_input[U_THRUST])
        self._largest = min(LARGEST_SHARE * self._hover, float(model.u_max[U_THRUST]))
        self._lag_s = max(model.lag_s[U_THRUST], 1e-3)
        self._delay_s = model.delay_s
        self._begun_s = math.inf
        self._floor_m = 0.0

    @property
    def under_way(self) -> bool:
        """Whether the vehicle stands with its rotor turning up."""
        return self._begun_s < math.inf

    def begin(self, time_s: float, floor_m: float) -> None:
        """Begin to turn the rotor up; `floor_m` is the height of the standing vehicle."""
        self._begun_s, self._floor_m = time_s, floor_m

    def end(self) -> None:
        """End the lift-off: the vehicle flies, or the take-off was given up."""
        self._begun_s = math.inf

    def thrust(self, time_s: float) -> float:
        """Return the thrust input to command now; 0 while no take-off is under way."""
        elapsed_s = max(0.0, time_s - self._begun_s)
        if elapsed_s < SPOOL_UP_S:
            return SPOOL_UP_SHARE * self._hover * elapsed_s / SPOOL_UP_S
        share = SPOOL_UP_SHARE + RISE_PER_S * (elapsed_s - SPOOL_UP_S)
        return min(share * self._hover, self._largest)

    def estimate(self, motion: Array, time_s: float) -> Estimate:
        """Return the estimate after lift-off from `motion`, shape (8,); the thrust carries the weight."""
        climbing = motion.copy()
        climbing[ZD_BODY] = LIFT_SPEED_M_S
        actuator, disturbance = np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE)
        actuator[U_THRUST] = self.thrust(time_s - self._delay_s - self._lag_s)
        disturbance[U_THRUST] = self._model.gravity_m_s2 - self._model.b[U_THRUST] * actuator[U_THRUST]
        return Estimate(climbing, actuator, disturbance)

    def lifted(self, height_m: float) -> bool:
        """Whether the vehicle has left the floor."""
        return self.under_way and height_m > self._floor_m + LIFTED_M

    def failed(self, time_s: float) -> bool:
        """Whether it should have lifted long ago."""
        expected_s = SPOOL_UP_S + (LIFTING_SHARE - SPOOL_UP_SHARE) / RISE_PER_S
        return time_s > self._begun_s + expected_s + PATIENCE_S


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
