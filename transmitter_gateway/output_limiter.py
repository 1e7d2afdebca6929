"""Inputs of the vehicle in each state: commands within slew rates, or inputs of the arbiter's own."""

import math
from collections import Counter

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.inputs import NEUTRAL, THRUST, Input
from rcopterx.transmitter_gateway.landing import RESPONSE_S, LandingLaw, Motion, climb_rate_m_s
from rcopterx.vehicles.state import GRAVITY_M_S2

HELD_S = 0.5
"""Time for which a frame may be repeated."""
BRAKING_M_S2 = 4.0
"""Deceleration of the fall afterwards, its delay included."""
TOUCHDOWN_M_S = 0.8
"""Speed at which a vehicle may touch the floor instead."""


def least_thrust_share(height_m: float, climb_m_s: float) -> float:
    """Smallest thrust over that of a hover that leaves the vehicle safe if it is repeated for `HELD_S`.

    On a starved computer a frame may be the last one for half a second, and receivers repeat it: a controller
    that brakes a climb would end on the floor. Afterwards the vehicle can brake above the floor, or it has
    reached the floor slowly.

    Parameters
    ----------
    height_m
        Height above the floor [m], positive.
    climb_m_s
        Climb rate [m/s], negative while it sinks.

    Returns
    -------
    float
        From 0 to 1.
    """
    # After T with the acceleration -a, the vehicle falls with s = a T - v at the height h + v T - a T^2 / 2.
    # If it needs all of this height to brake, s^2 / (2 b), then s^2 + b T s - 2 b (h + v T / 2) = 0.
    room = 2.0 * BRAKING_M_S2 * (height_m + climb_m_s * HELD_S / 2.0)
    linear = BRAKING_M_S2 * HELD_S
    fall_m_s = (math.sqrt(max(linear**2 + 4.0 * room, 0.0)) - linear) / 2.0
    recovered_m_s2 = (fall_m_s + climb_m_s) / HELD_S
    touched_m_s2 = (TOUCHDOWN_M_S**2 - climb_m_s**2) / (2.0 * height_m)
    return min(max(1.0 - max(recovered_m_s2, touched_m_s2) / GRAVITY_M_S2, 0.0), 1.0)


FILTER_S = 1.0
TRUSTED_S = 3.0  # the same of what a descent without poses may begin with: the newest poses may be wrong
PRIOR_S = 0.2  # flight time that counts as much as the first value
PRIOR_DOUBT = 0.15  # error of the first value, as a share of it, that a descent without poses allows for
LEAST = 0.3  # smallest load over weight, and hover thrust over the calibrated one
SETTLING_S = 0.15  # until the low-pass of the climb rate has forgotten the time when the vehicle was not seen
LONGEST_STEP_S = 0.1  # the climb rate after a longer pause says nothing about the thrust


class _Means:
    """Means of thrust and vertical acceleration over a flight, at most over `longest_s`."""

    def __init__(self, longest_s: float, thrust: float) -> None:
        self._longest_s, self._thrust, self._m_s2 = longest_s, thrust, 0.0

    def note(self, thrust: float, gained_m_s: float, elapsed_s: float, known_s: float) -> None:
        filter_s = min(self._longest_s, PRIOR_S + known_s)
        self._thrust += (thrust - self._thrust) * elapsed_s / filter_s
        self._m_s2 += (gained_m_s - self._m_s2 * elapsed_s) / filter_s

    def hover(self, weight_m_s2: float) -> float:
        """Thrust at which the vehicle hovers."""
        return self._thrust / max(1.0 + self._m_s2 / weight_m_s2, LEAST)


class HoverThrust:
    """Hover thrust: the calibrated one, corrected by the motion that the vehicle is seen in.

    A descent without poses is open loop. With an error of eight per cent in the thrust gain, which any
    battery may cause, a vehicle touches down at 2 m/s, or hovers until its motors are cut. In the air, it
    accelerates upwards by as much of its weight as its thrust exceeds that of a hover. So the mean thrust of
    any time, over one plus the mean acceleration in units of the weight, is the hover thrust: the mean of the
    flight so far, at first of all of it, then a low-pass.

    `gain_m_s2` is the vertical acceleration per thrust of a vehicle that hovers as calibrated. `climb_m_s` is
    the climb rate, predicted while a vehicle that flew is not seen. `known_s` is for how long it was seen.
    """

    def __init__(self, calibrated: float, largest_correction: float, gain_m_s2: float) -> None:
        self._calibrated = calibrated
        self._lower = max(calibrated - largest_correction, LEAST * calibrated)
        self._upper = min(calibrated + largest_correction, 1.0)
        self._weight_m_s2 = gain_m_s2 * calibrated
        self.begin(calibrated, 0.0)

    def begin(self, first: float, acting: float, known_s: float = 0.0) -> None:
        """Begin while a thrust acts; `first` is the hover thrust of `PRIOR_S` and `known_s` of flight."""
        self._newest, self._steady = _Means(FILTER_S, first), _Means(TRUSTED_S, first)
        self._acting, self.known_s = acting, known_s
        self._seen_s = self.climb_m_s = 0.0
        self._aloft = known_s > 0.0  # whether it has been seen in the air

    @property
    def value(self) -> float:
        """Thrust at which the vehicle hovers, within `largest_correction` of the calibrated one."""
        return min(max(self._newest.hover(self._weight_m_s2), self._lower), self._upper)

    @property
    def trusted(self) -> float:
        """The same, but not above the mean of the last seconds: a pose that is not its own raises `value`."""
        return min(self.value, max(self._steady.hover(self._weight_m_s2), self._lower))

    @property
    def scale(self) -> float:
        """Thrust that this vehicle needs for an acceleration, over that of one that hovers as calibrated."""
        return self.value / self._calibrated

    def below(self, share: float) -> float:
        """Thrust that surely sinks: less than `trusted` by a share of it, and by its doubt."""
        doubt = PRIOR_DOUBT * PRIOR_S / (PRIOR_S + self.known_s)
        return self.trusted * (1.0 - share - doubt)

    def note(self, thrust: float, elapsed_s: float, climb_m_s: float | None) -> None:
        """Use the thrust applied for `elapsed_s` and the climb rate after it, None if not seen in the air.

        Updates the means, over the flight and at most `FILTER_S` or `TRUSTED_S`, of the thrust T after a
        low-pass with `RESPONSE_S`, and of the acceleration a from climb rates; a mean gives the hover thrust
        mean(T) / (1 + mean(a) / g).
        """
        self._acting -= math.expm1(-elapsed_s / RESPONSE_S) * (thrust - self._acting)
        self._seen_s += elapsed_s
        if climb_m_s is None:
            self._seen_s = 0.0
            if self._aloft:
                self.climb_m_s += self._weight_m_s2 * (self._acting / self.value - 1.0) * elapsed_s
            return
        before_m_s, self.climb_m_s, self._aloft = self.climb_m_s, climb_m_s, True
        if self._seen_s <= SETTLING_S or elapsed_s > LONGEST_STEP_S:
            return
        self.known_s += elapsed_s
        for means in (self._newest, self._steady):
            means.note(self._acting, climb_m_s - before_m_s, elapsed_s, self.known_s)


LONGEST_SLEW_STEP_S = 0.04
FADE_PER_S = 0.05  # fall of the thrust from when a descent should have reached the floor: gently
LEAST_SHARE = 0.3  # share of the hover thrust below which no rotor of a vehicle in the air is slowed
BRAKING = 0.2  # thrust per climb rate [s/m] by which a vehicle that is not seen is braked


class OutputLimiter:
    """Inputs of one vehicle from step to step; `u` are those applied now.

    `hover` learns the thrust of a hover, `law` holds and lands the vehicle.
    """

    def __init__(
        self, limits: ArbiterLimits, u_hover: float, slew_per_s: Input, counters: Counter[str]
    ) -> None:
        self.u: Input = NEUTRAL
        self._limits = limits
        self._u_hover, self._slew_per_s = u_hover, slew_per_s
        self._counters = counters
        self.hover = HoverThrust(u_hover, limits.hover_correction, limits.landing.input_gain[2])
        self.law = LandingLaw(limits.landing)
        self._moved_s = 4 * [-math.inf]
        self._braked = 0.0
        self._flew = False  # whether the vehicle was in the air when it was located last

    def stop(self) -> None:
        """Apply nothing."""
        self.u = NEUTRAL
        self._braked, self._flew = 0.0, False
        self.law.renew()
        self.hover.begin(self._u_hover, 0.0)

    def take_over(self, u: Input, hover_thrust: float, known_s: float) -> None:
        """Continue from the inputs of an earlier process and the hover thrust that it learned."""
        self.u = u
        self.hover.begin(hover_thrust, u[THRUST], known_s)

    def play(self, target: Input, now_s: float, height_m: float | None, *, unproved: bool = False) -> None:
        """Apply a command within slew rates over the time since the last move, which steps do not use up.

        A vehicle at a height above the floor, not None, keeps the thrust that it survives if it is repeated.
        The thrust of a lift-off that is `unproved` has none below hover, nor downwards.
        """
        self.law.renew()
        self._braked = 0.0
        if height_m is not None:
            target = self._survivable(target, height_m)
        limited: list[float] = []
        axes = zip(target, self.u, self._slew_per_s, self._moved_s, strict=True)
        for axis, (wanted, last, rate, moved_s) in enumerate(axes):
            value = wanted
            if wanted != last:
                most = rate * min(now_s - moved_s, LONGEST_SLEW_STEP_S)
                self._moved_s[axis] = now_s
                low, high = last - most, last + most
                if axis == THRUST and unproved:
                    low, high = 0.0, max(last, self.hover.value) + most
                value = min(max(wanted, low), high)
            limited.append(value)
        self.u = (limited[0], limited[1], limited[2], limited[3])
        if self.u != target:
            self._counters["steps slew limited"] += 1

    def _survivable(self, target: Input, height_m: float) -> Input:
        """Limit the thrust downwards; see `least_thrust_share`."""
        pitch, roll, thrust, yaw = target
        least = self.hover.value * least_thrust_share(height_m, self.hover.climb_m_s)
        if thrust < least:
            self._counters["thrusts limited downwards"] += 1
        return (pitch, roll, max(thrust, least), yaw)

    def learn_hover(self, elapsed_s: float, climb_m_s: float | None, *, located: bool) -> None:
        """Use the climb rate after `elapsed_s` of the present inputs, None if not seen in the air.

        A vehicle is `located` while it is certain whether it is in the air.
        """
        if located:
            self._flew = climb_m_s is not None
        self.hover.note(self.u[THRUST], elapsed_s, climb_m_s)

    def hold(self, motion: Motion | None, elapsed_s: float) -> None:
        """Hold the place; without a motion level the vehicle and end its climb."""
        if motion is None:
            self._level(self.hover.trusted, self._limits.descend_rate_per_s, elapsed_s)
        else:
            self._fly(motion, 0.0, elapsed_s)

    def land(self, motion: Motion, floor_m: float, landing_s: float, elapsed_s: float) -> None:
        """Descend straight to the floor; `landing_s` is the time since the landing began."""
        limits, brakes = self._limits.landing, self.law.brakes
        self._fly(motion, climb_rate_m_s(motion, floor_m, landing_s, limits, brakes=brakes), elapsed_s)

    def sink(self, thrust: float) -> None:
        """Apply a thrust, level."""
        self.law.release()
        self._braked = 0.0
        self.u = (0.0, 0.0, thrust, 0.0)

    def descend(self, elapsed_s: float, *, late: bool) -> None:
        """Descend level without poses, thrust a little below hover, the closer the faster it should sink.

        From when the floor should be reached, `late`, the thrust fades, because it may be that of a hover.
        """
        if late:
            self._level(0.0, FADE_PER_S, elapsed_s)
        else:
            sinking = self.hover.below(self._limits.below_hover(self.hover.climb_m_s))
            self._level(sinking, self._limits.descend_rate_per_s, elapsed_s)

    def _level(self, thrust: float, rate_per_s: float, elapsed_s: float) -> None:
        """Level the vehicle and lower its thrust at a rate to `thrust`, and by more while it climbs."""
        # A lower thrust is raised if the vehicle was last located in the air, else it would fall.
        self.law.release()
        before = min(self.u[THRUST] + self._braked, self.hover.trusted)
        raised = before + (self._slew_per_s[THRUST] * elapsed_s if self._flew else 0.0)
        level = max(min(raised, thrust), before - rate_per_s * elapsed_s)
        self._braked = BRAKING * self.hover.scale * max(self.hover.climb_m_s, 0.0)
        self._braked = min(self._braked, (1.0 - LEAST_SHARE) * level)
        self.u = (0.0, 0.0, level - self._braked, 0.0)

    def _fly(self, motion: Motion, climb_m_s: float, elapsed_s: float) -> None:
        self._braked = 0.0
        hover = self.hover.value
        pitch, roll, thrust, yaw = self.law.step(motion, climb_m_s, hover, elapsed_s)
        thrust = max(hover + self.hover.scale * (thrust - hover), LEAST_SHARE * hover)
        axes = zip((pitch, roll, thrust, yaw), self._limits.lower, self._limits.upper, strict=True)
        pitch, roll, thrust, yaw = (min(max(value, lower), upper) for value, lower, upper in axes)
        self.u = (pitch, roll, thrust, yaw)
