"""Holding and landing without commands: a fixed feedback law on raw poses.

Horizontally, position and velocity feedback at 1.3 rad/s on the nominal acceleration of the sticks.
Vertically, proportional-integral feedback of the climb rate around the hover thrust. Yaw is held by
proportional feedback. A vehicle that falls is braked with up to all its thrust. The law is stable with half
to one and a half times the nominal gains and 60 ms from pose to air, on a first-order vehicle and on a
helicopter whose tilt swings at 10 to 17 rad/s. The measured tilt is not fed back: through that delay it would
amplify the swinging.

A vehicle that becomes faster under this law does not obey its sticks. A stick that demonstrably acts the
wrong way round is reversed, and the vehicle brakes. Otherwise the swash plate is left level, which
accelerates the vehicle no further. A stick that has long commanded much without effect is left at rest. A
vehicle that has become faster, or has lost a stick, descends faster; height and yaw control continue.
"""

import math

from msgspec import Struct

from rcopterx.radios.limits import LandingLimits
from rcopterx.transmitter_gateway.inputs import Input, Position

POSITION_GAIN_PER_S2 = 1.6
VELOCITY_GAIN_PER_S = 2.0
LARGEST_ERROR_M = 0.3  # further away, the vehicle approaches at the speed that belongs to this error
CLIMB_GAIN_PER_S = 2.0
CLIMB_INTEGRAL_PER_S2 = 1.0
LARGEST_INTEGRAL_M_S2 = 2.5
THROWN_M_S = 0.2  # a vehicle that climbs faster than this above the set point bounced; more is not integrated
FALL_M_S = 1.0  # a vehicle that sinks so much faster than the set point falls...
FALL_GAIN_PER_S = 6.0  # ...and is braked with all its thrust
CLIMB_CHANGE_M_S2 = 0.5  # rate at which the climb rate set point changes; a step would overshoot
CUSHION_M = 0.05  # so near the floor the ground carries part of the weight: who sinks slowly there, floats
GAINED_M_S = 0.4  # a vehicle that has gained so much speed since it was slowest under the law...
FASTER_S = 0.1  # ...is not waited for, if it lasts so long; a pose that jumps is no speed...
ASTRAY_S = 0.2  # ...and does not obey its sticks, if it lasts so long
RESPONSE_S = 0.15  # from a stick to the measured velocity: pose to air, tilt, filter
REMEMBERED_S = 1.0
REVERSED = -0.3  # a stick whose effect is less than this share of the nominal one acts the wrong way round
USELESS = 0.2  # ...and one whose effect is less than this does not act at all,
ENOUGH_EFFORT = 1.4  # once it has asked for so much: the integral of its acceleration squared [m^2/s^3]
JUDGED_S = 0.5  # ...and for so long: before, a quick vehicle has not answered
HURRY = 2.0  # factor of descents that are not braked, up to this factor of the flare's height...
HURRIED_CHANGE_M_S2 = 1.5  # ...and its climb rate changes so fast
YAW_GAIN_PER_S = 1.0
LONGEST_STEP_S = 0.05


class Motion(Struct, frozen=True):
    """Where the vehicle is and how it moves, in the inertial frame [m, m/s, rad]."""

    position_m: Position
    velocity_m_s: Position
    yaw_rad: float
    clear_place_m: Position | None = None
    """Place to go to, clear of the vehicles that are too close; None if there are none."""


class LandingLaw:
    """Holds a vehicle over one place while it hovers or descends."""

    def __init__(self, limits: LandingLimits) -> None:
        self._limits = limits
        self._yaw_rad = 0.0
        self._used = True
        self.renew()

    def release(self) -> None:
        """Forget the place, but not the effect of the sticks; the next step begins where the vehicle is."""
        self._place: Position | None = None
        self._slowest_m_s = math.inf
        self._settling_s: float | None = None
        self._astray_s = self._climb_m_s = self._climb_integral_m_s2 = 0.0
        for effect in self._effects:
            effect.pause()

    def renew(self) -> None:
        """Reset: the vehicle was flown by commands, or has not flown."""
        if self._used:
            self._used = self._faster = False
            self._effects = (StickEffect(), StickEffect())
            self.release()

    @property
    def obeyed(self) -> bool:
        """Whether no stick of the swash plate had to be given up since the law began."""
        return all(effect.sense for effect in self._effects)

    @property
    def brakes(self) -> bool:
        """Whether the vehicle has not become faster since the law began, nor had a stick given up."""
        return self.obeyed and not self._faster

    def step(self, motion: Motion, climb_m_s: float, hover_thrust: float, elapsed_s: float) -> Input:
        """Pitch, roll, thrust and yaw that hold the place at a climb rate, negative to descend."""
        self._used = True
        if self._place is None:
            self._place, self._yaw_rad = motion.position_m, motion.yaw_rad
        if motion.clear_place_m is not None:
            # The speed that it gains on the way is no disobedience.
            self._place, self._slowest_m_s = motion.clear_place_m, math.inf
        self._watch(motion, elapsed_s)
        limits, gain = self._limits, self._limits.input_gain
        cyclic = self._cyclic(motion, self._place)
        step_s = min(elapsed_s, LONGEST_STEP_S)
        change_m_s2 = CLIMB_CHANGE_M_S2 if self.brakes else HURRIED_CHANGE_M_S2
        self._climb_m_s += _limited(climb_m_s - self._climb_m_s, change_m_s2 * step_s)
        climb_error = self._climb_m_s - motion.velocity_m_s[2]
        integral = self._climb_integral_m_s2
        integral += CLIMB_INTEGRAL_PER_S2 * max(climb_error, -THROWN_M_S) * step_s
        self._climb_integral_m_s2 = integral = _limited(integral, LARGEST_INTEGRAL_M_S2)
        lift = _limited((CLIMB_GAIN_PER_S * climb_error + integral) / gain[2], limits.thrust)
        lift += FALL_GAIN_PER_S * max(climb_error - FALL_M_S, 0.0) / gain[2]
        turned_rad = math.remainder(motion.yaw_rad - self._yaw_rad, math.tau)
        return (
            *cyclic,
            hover_thrust + lift,
            _limited(-YAW_GAIN_PER_S * turned_rad / limits.yaw_rate_gain_rad_s, limits.yaw),
        )

    def _watch(self, motion: Motion, elapsed_s: float) -> None:
        """Notice that the vehicle runs away; one that has is not trusted again."""
        speed_m_s = math.hypot(motion.velocity_m_s[0], motion.velocity_m_s[1])
        if self._settling_s is None:  # the tilt of its last commands may gain that much before it responds
            quick = RESPONSE_S * max(self._limits.input_gain[:2]) > GAINED_M_S
            self._settling_s = JUDGED_S if quick and speed_m_s > GAINED_M_S else 0.0
        self._settling_s -= elapsed_s
        turning = any(effect.sense < 0.0 and effect.acted_s < JUDGED_S for effect in self._effects)
        settles = turning or self._settling_s > 0.0
        self._slowest_m_s = math.inf if settles else min(self._slowest_m_s, speed_m_s)
        gained_m_s = speed_m_s - self._slowest_m_s
        self._astray_s = self._astray_s + elapsed_s if gained_m_s > GAINED_M_S else 0.0
        self._faster = self._faster or self._astray_s > FASTER_S
        speeds_m_s = _along_heading(*motion.velocity_m_s[:2], motion.yaw_rad)
        for effect, along_m_s in zip(self._effects, speeds_m_s, strict=True):
            effect.note(along_m_s, elapsed_s)
        if self._astray_s > ASTRAY_S:
            self._astray_s, self._slowest_m_s = 0.0, math.inf
            worst = min(self._effects, key=lambda effect: effect.work)
            if not worst.turn_round():
                for effect in self._effects:
                    effect.sense = 0.0

    def _cyclic(self, motion: Motion, place: Position) -> tuple[float, float]:
        """Pitch and roll that hold the place."""
        limit, (forward_gain, left_gain, _) = self._limits.cyclic, self._limits.input_gain
        forward, left = self._acceleration_m_s2(motion, place)
        pitch, roll = _limited(forward / forward_gain, limit), _limited(left / left_gain, limit)
        along, across = self._effects
        along.commanded_m_s2, across.commanded_m_s2 = pitch * forward_gain, roll * left_gain
        return along.sense * pitch, across.sense * roll

    def _acceleration_m_s2(self, motion: Motion, place: Position) -> tuple[float, float]:
        """Acceleration towards the place along the heading and to its left."""
        error_x, error_y = place[0] - motion.position_m[0], place[1] - motion.position_m[1]
        distance = math.hypot(error_x, error_y)
        weight = POSITION_GAIN_PER_S2 * min(1.0, LARGEST_ERROR_M / distance if distance > 0 else 1.0)
        x = weight * error_x - VELOCITY_GAIN_PER_S * motion.velocity_m_s[0]
        y = weight * error_y - VELOCITY_GAIN_PER_S * motion.velocity_m_s[1]
        return _along_heading(x, y, motion.yaw_rad)


class StickEffect:
    """Effect of one stick of the swash plate, compared with its nominal effect.

    `sense` is 1, -1 for a stick that acts the wrong way round, 0 for one that is not used any more.
    `commanded_m_s2` is the nominal acceleration of the present command; low-passed with `RESPONSE_S` it is a.
    `acted_s` is for how long it has commanded since it was turned round, or since the beginning.
    `work` is the integral of a dv over the gained velocity v, with forgetting (`REMEMBERED_S`) [m^2/s^3].
    """

    def __init__(self) -> None:
        self.sense = 1.0
        self.commanded_m_s2 = 0.0
        self.work = 0.0
        self._due_m_s2 = 0.0
        self._speed_m_s: float | None = None
        self._effort = self.acted_s = 0.0

    def note(self, speed_m_s: float, elapsed_s: float) -> None:
        """Use the speed along the stick's axis after a step, and stop using a stick without effect."""
        self._due_m_s2 += -math.expm1(-elapsed_s / RESPONSE_S) * (self.commanded_m_s2 - self._due_m_s2)
        gained_m_s = 0.0 if self._speed_m_s is None else speed_m_s - self._speed_m_s
        self._speed_m_s = speed_m_s
        kept = math.exp(-elapsed_s / REMEMBERED_S)
        self.work = kept * self.work + self._due_m_s2 * gained_m_s
        self._effort = kept * self._effort + self._due_m_s2**2 * elapsed_s
        self.acted_s += elapsed_s * (self.commanded_m_s2 != 0.0)
        certain = self._effort > ENOUGH_EFFORT and self.acted_s > JUDGED_S
        if certain and self.share < USELESS and not self.turn_round():
            self.sense = 0.0

    def pause(self) -> None:
        """Ignore the motion until the next step, which does not follow from this stick."""
        self.commanded_m_s2 = self._due_m_s2 = 0.0
        self._speed_m_s = None

    @property
    def share(self) -> float:
        """Effect over the nominal one; 0 before the first command.

        The least-squares estimate of k in dv = k a dt: the integral of a dv over that of a^2 dt.
        """
        return self.work / self._effort if self._effort > 0.0 else 0.0

    def turn_round(self) -> bool:
        """Use the stick the other way round if that is how it acts; whether it is. Only once."""
        if self.sense < 1.0 or self.share > REVERSED:
            return False
        self.sense, self.work, self._effort, self.acted_s = -1.0, 0.0, 0.0, 0.0
        self._due_m_s2 = -self._due_m_s2  # as it still accelerates
        return True


def _along_heading(x: float, y: float, yaw_rad: float) -> tuple[float, float]:
    """Components along the heading and to its left."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return c * x + s * y, c * y - s * x


def climb_rate_m_s(
    motion: Motion, floor_m: float, landing_s: float, limits: LandingLimits, *, brakes: bool = True
) -> float:
    """Climb rate of a landing: none while the vehicle brakes, then down, slowly just above the floor.

    `landing_s` is the time since the landing began; a vehicle that becomes faster (not `brakes`) descends at
    once and faster.
    """
    speed_m_s = math.hypot(motion.velocity_m_s[0], motion.velocity_m_s[1])
    if brakes and speed_m_s > limits.braked_m_s and landing_s < limits.braking_s:
        return 0.0
    height_m = motion.position_m[2] - floor_m
    if not brakes and height_m > HURRY * limits.flare_m:
        return -HURRY * limits.descent_m_s
    return -limits.touchdown_m_s if CUSHION_M < height_m < limits.flare_m else -limits.descent_m_s


def _limited(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


AT_FLOOR_M = 0.01
STILL_M_S = 0.1
AT_FLOOR_S = 0.2
STILL_M = 0.02
STILL_S = 3.0
"""A vehicle that has been still for so long, although the law lowers its thrust until it sinks, stands on
something; in the air, none would be still for half of that time."""


class Touchdown:
    """Whether one vehicle that comes down stands, from its height and its climb rate."""

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
