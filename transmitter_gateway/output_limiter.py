"""Inputs of the vehicle in each state: commands within slew rates, or inputs of the arbiter's own."""

import math
from collections import Counter

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.held_frames import least_thrust_share
from rcopterx.transmitter_gateway.hover import HoverThrust
from rcopterx.transmitter_gateway.inputs import NEUTRAL, THRUST, Input
from rcopterx.transmitter_gateway.landing import LandingLaw, Motion, climb_rate_m_s

LONGEST_SLEW_STEP_S = 0.04
FADE_PER_S = 0.05  # fall of the thrust after a descent, while a vehicle is seen in the air: gently
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
        self._braked = 0.0
        self._flew = False
        self.law.renew()
        self.hover.begin(self._u_hover, 0.0)

    def take_over(self, u: Input, hover_thrust: float) -> None:
        """Continue from the inputs of an earlier process and the hover thrust that it learned."""
        self.u = u
        self.hover.begin(hover_thrust, u[THRUST])

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
            self._level(self.hover.value, self._limits.descend_rate_per_s, elapsed_s)
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

    def descend(self, elapsed_s: float, *, over: bool) -> None:
        """Descend level without poses, thrust a little below hover; if `over` in the air, without thrust."""
        if over:
            self._level(0.0, FADE_PER_S, elapsed_s)
        else:
            sinking = self.hover.below(self._limits.descend_below_hover)
            self._level(sinking, self._limits.descend_rate_per_s, elapsed_s)

    def _level(self, thrust: float, rate_per_s: float, elapsed_s: float) -> None:
        """Level the vehicle and lower its thrust, from that of a hover at most, at a rate to `thrust`.

        A lower thrust is raised to `thrust` at the slew rate if the vehicle was last located in the air, else
        it would fall. From the result a thrust in proportion to the climb rate is subtracted.
        """
        self.law.release()
        before = min(self.u[THRUST] + self._braked, self.hover.value)
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
        pitch, roll, thrust, yaw = (
            min(max(value, lower), upper)
            for value, lower, upper in zip(
                (pitch, roll, thrust, yaw), self._limits.lower, self._limits.upper, strict=True
            )
        )
        self.u = (pitch, roll, thrust, yaw)
