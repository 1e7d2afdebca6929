"""Holding and landing by itself: a fixed feedback law on raw poses, for a vehicle that nobody commands.

Horizontally, position and velocity feedback at 1.3 rad/s on the nominal acceleration of the sticks.
Vertically, proportional-integral feedback of the climb rate around the hover thrust. Yaw is held by
proportional feedback. It is stable with half to one and a half times the nominal gains and 60 ms from pose to
air, on a first-order vehicle and on a helicopter whose tilt swings at 10 to 17 rad/s. The measured tilt is
not fed back: through that delay it makes the swinging worse.

A vehicle that becomes faster and faster under this law does not obey its sticks: one acts the wrong way
round, or not at all. Its swash plate is then left level, which drives it no further; height and yaw go on.
"""

from __future__ import annotations

import math

from msgspec import Struct

from rcopterx.transmitter_gateway.inputs import Input, Position
from rcopterx.transmitter_gateway.limits import LandingLimits

POSITION_GAIN_PER_S2 = 1.6
VELOCITY_GAIN_PER_S = 2.0
LARGEST_ERROR_M = 0.3
"""Further away, the vehicle approaches at the speed that belongs to this error."""
CLIMB_GAIN_PER_S = 2.0
CLIMB_INTEGRAL_PER_S2 = 1.0
LARGEST_INTEGRAL_M_S2 = 2.5
CLIMB_CHANGE_M_S2 = 0.5
"""How fast the climb rate that is asked for changes; a step would overshoot."""
CUSHION_M = 0.05
"""So near the floor the ground carries part of the weight: who sinks slowly there, floats."""
ASTRAY_M_S = 0.4
"""A vehicle that has gained so much speed since it was slowest under the law does not obey its sticks..."""
ASTRAY_S = 0.2
"""...if it lasts so long; a pose that jumps is no speed."""
YAW_GAIN_PER_S = 1.0
LONGEST_STEP_S = 0.05


class Motion(Struct, frozen=True):
    """Where the vehicle is and how it moves, in the inertial frame [m, m/s, rad]."""

    position_m: Position
    velocity_m_s: Position
    yaw_rad: float


class LandingLaw:
    """Holds a vehicle over one place while it hovers or descends.

    Parameters
    ----------
    limits : LandingLimits
        Nominal gains of the sticks and limits of what the law asks of them.

    Attributes
    ----------
    obeyed : bool
        Whether the vehicle has not run away since the law began.
    """

    def __init__(self, limits: LandingLimits) -> None:
        self._limits = limits
        self._place: Position | None = None
        self._yaw_rad = 0.0
        self._climb_m_s = 0.0
        self._climb_integral_m_s2 = 0.0
        self._slowest_m_s = math.inf
        self._astray_s = 0.0
        self.obeyed = True

    def release(self) -> None:
        """Forget the place; the next step begins where the vehicle is then, and lets it obey again."""
        self._place = None
        self._slowest_m_s = math.inf
        self._astray_s = 0.0
        self.obeyed = True
        self._climb_m_s = 0.0
        self._climb_integral_m_s2 = 0.0

    def step(self, motion: Motion, climb_m_s: float, hover_thrust: float, elapsed_s: float) -> Input:
        """Inputs that hold the place at a climb rate.

        Parameters
        ----------
        motion : Motion
            Newest pose of the vehicle with its velocity.
        climb_m_s : float
            Climb rate asked for; negative to descend [m/s].
        hover_thrust : float
            Thrust at which the vehicle hovers.
        elapsed_s : float
            Time since the last step [s].

        Returns
        -------
        tuple of float
            Pitch, roll, thrust, yaw.
        """
        if self._place is None:
            self._place, self._yaw_rad = motion.position_m, motion.yaw_rad
        self._watch(motion, elapsed_s)
        forward, left = self._acceleration_m_s2(motion, self._place) if self.obeyed else (0.0, 0.0)
        limits, gain = self._limits, self._limits.input_gain
        step_s = min(elapsed_s, LONGEST_STEP_S)
        self._climb_m_s += _limited(climb_m_s - self._climb_m_s, CLIMB_CHANGE_M_S2 * step_s)
        climb_error = self._climb_m_s - motion.velocity_m_s[2]
        integral = self._climb_integral_m_s2 + CLIMB_INTEGRAL_PER_S2 * climb_error * step_s
        self._climb_integral_m_s2 = integral = _limited(integral, LARGEST_INTEGRAL_M_S2)
        lift = (CLIMB_GAIN_PER_S * climb_error + integral) / gain[2]
        turned_rad = math.remainder(motion.yaw_rad - self._yaw_rad, math.tau)
        return (
            _limited(forward / gain[0], limits.cyclic),
            _limited(left / gain[1], limits.cyclic),
            hover_thrust + _limited(lift, limits.thrust),
            _limited(-YAW_GAIN_PER_S * turned_rad / limits.yaw_rate_gain_rad_s, limits.yaw),
        )

    def _watch(self, motion: Motion, elapsed_s: float) -> None:
        """Notice that the vehicle runs away; one that has is not trusted again."""
        speed_m_s = math.hypot(motion.velocity_m_s[0], motion.velocity_m_s[1])
        self._slowest_m_s = min(self._slowest_m_s, speed_m_s)
        astray = speed_m_s > self._slowest_m_s + ASTRAY_M_S
        self._astray_s = self._astray_s + elapsed_s if astray else 0.0
        if self._astray_s > ASTRAY_S:
            self.obeyed = False

    def _acceleration_m_s2(self, motion: Motion, place: Position) -> tuple[float, float]:
        """Acceleration towards the place along the heading and to its left."""
        error_x, error_y = place[0] - motion.position_m[0], place[1] - motion.position_m[1]
        distance = math.hypot(error_x, error_y)
        weight = POSITION_GAIN_PER_S2 * min(1.0, LARGEST_ERROR_M / distance if distance > 0 else 1.0)
        x = weight * error_x - VELOCITY_GAIN_PER_S * motion.velocity_m_s[0]
        y = weight * error_y - VELOCITY_GAIN_PER_S * motion.velocity_m_s[1]
        c, s = math.cos(motion.yaw_rad), math.sin(motion.yaw_rad)
        return c * x + s * y, c * y - s * x


def climb_rate_m_s(motion: Motion, floor_m: float, landing_s: float, limits: LandingLimits) -> float:
    """Climb rate of a landing: none while the vehicle brakes, then down, slowly just above the floor.

    Parameters
    ----------
    motion : Motion
        Newest pose of the vehicle with its velocity.
    floor_m : float
        Height at which the vehicle stands [m].
    landing_s : float
        Time since the landing began [s].
    limits : LandingLimits
        Speeds.
    """
    speed_m_s = math.hypot(motion.velocity_m_s[0], motion.velocity_m_s[1])
    if speed_m_s > limits.braked_m_s and landing_s < limits.braking_s:
        return 0.0
    flaring = CUSHION_M < motion.position_m[2] - floor_m < limits.flare_m
    return -limits.touchdown_m_s if flaring else -limits.descent_m_s


def _limited(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
