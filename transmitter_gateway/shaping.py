"""Inputs of the vehicle in each state: commands within slew rates, or inputs of the arbiter's own."""

from __future__ import annotations

import math
from collections import Counter

from rcopterx.transmitter_gateway.hover import HoverThrust
from rcopterx.transmitter_gateway.inputs import NEUTRAL, THRUST, Input
from rcopterx.transmitter_gateway.landing import LandingLaw, Motion, climb_rate_m_s
from rcopterx.transmitter_gateway.limits import ArbiterLimits
from rcopterx.transmitter_gateway.surveillance import Track

LONGEST_SLEW_STEP_S = 0.04
FADE_PER_S = 0.05
"""How slowly the thrust falls while a vehicle is still seen in the air after its descent: it sinks gently."""


class Shaping:
    """Inputs of one vehicle from step to step; `u` are those applied now."""

    def __init__(
        self, limits: ArbiterLimits, u_hover: float, slew_per_s: Input, counters: Counter[str]
    ) -> None:
        self.u: Input = NEUTRAL
        self._limits = limits
        self._slew_per_s = slew_per_s
        self._counters = counters
        self._hover = HoverThrust(u_hover, limits.hover_correction, limits.airborne_m)
        self._law = LandingLaw(limits.landing)
        self._moved_s = 4 * [-math.inf]

    @property
    def missing_thrust(self) -> float:
        """Hover thrust less the applied thrust."""
        return self._hover.value - self.u[THRUST]

    @property
    def obeyed(self) -> bool:
        """Whether the vehicle obeys its sticks while it is held and landed."""
        return self._law.obeyed

    def stop(self) -> None:
        """Apply nothing."""
        self.u = NEUTRAL
        self._law.renew()

    def play(self, target: Input, now_s: float) -> None:
        """Apply a command within the slew rates.

        The time since an input moved last allows its next move: steps in between, for poses or deadlines, do
        not use it up.
        """
        self._law.renew()
        limited: list[float] = []
        axes = zip(target, self.u, self._slew_per_s, self._moved_s, strict=True)
        for axis, (wanted, last, rate, moved_s) in enumerate(axes):
            value = wanted
            if wanted != last:
                most = rate * min(now_s - moved_s, LONGEST_SLEW_STEP_S)
                self._moved_s[axis] = now_s
                value = min(max(wanted, last - most), last + most)
            limited.append(value)
        self.u = (limited[0], limited[1], limited[2], limited[3])
        self._counters["steps slew limited"] += self.u != target

    def learn_hover(self, elapsed_s: float, track: Track | None, floor_m: float, now_s: float) -> None:
        """Correct the hover thrust by the thrust applied for `elapsed_s` up to `now_s`."""
        self._hover.note(self.u[THRUST], elapsed_s, track, floor_m, now_s)

    def hold(self, motion: Motion | None, elapsed_s: float) -> None:
        """Hold the place; without a motion level the vehicle and never add thrust."""
        if motion is None:
            self._law.release()
            self.u = (0.0, 0.0, min(self.u[THRUST], self._hover.value), 0.0)
        else:
            self._fly(motion, 0.0, elapsed_s)

    def land(self, motion: Motion, floor_m: float, landing_s: float, elapsed_s: float) -> None:
        """Descend straight to the floor; `landing_s` is the time since the landing began."""
        limits, brakes = self._limits.landing, self._law.brakes
        self._fly(motion, climb_rate_m_s(motion, floor_m, landing_s, limits, brakes=brakes), elapsed_s)

    def descend(self, elapsed_s: float, *, over: bool) -> None:
        """Come down in open loop: level, the thrust falls to a little less than that of a hover.

        A descent that is `over` in the air ends without thrust.
        """
        self._law.release()
        thrust = min(self.u[THRUST], self._hover.value)
        lowest, rate_per_s = 0.0, FADE_PER_S
        if not over:
            lowest = min(thrust, self._hover.value - self._limits.descend_below_hover)
            rate_per_s = self._limits.descend_rate_per_s
        self.u = (0.0, 0.0, max(lowest, thrust - rate_per_s * elapsed_s), 0.0)

    def _fly(self, motion: Motion, climb_m_s: float, elapsed_s: float) -> None:
        wanted = self._law.step(motion, climb_m_s, self._hover.value, elapsed_s)
        pitch, roll, thrust, yaw = (
            min(max(value, lower), upper)
            for value, lower, upper in zip(wanted, self._limits.lower, self._limits.upper, strict=True)
        )
        self.u = (pitch, roll, thrust, yaw)
