"""Whether a vehicle does what its sticks say: a weak rotor, an empty battery, an axis without effect.

What a stick should have done within a window is compared with what the vehicle did. For each axis the model
says

    velocity' = gain * (stick after delay and lag) + damping * velocity + turning of the frame - gravity

so the change of the velocity, less damping, turning and gravity, is what the stick has done; its ratio to
what the model says is the axis's effect: 1 for the model, 0 for a dead axis, negative for a reversed one.
Wind adds to it, and so only windows count in which a stick asked for more than any wind indoors does. A
stick that swings from one side to the other does not count: a vehicle that oscillates answers late and is
not broken.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.native.watching import (
    AXIS_AT_FAULT,
    BATTERY_EMPTY,
    EFFECT,
    FULL_FOR_S,
    GAIN,
    HOVER_THRUST,
    KNOWN,
    LEARNT_GAIN,
    RULES,
    SOUND,
    SUSPECT_S,
    THRUST_EXHAUSTED,
    THRUST_LOST,
    THRUST_WINDOW_S,
    watch_effects,
)
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_PITCH, U_ROLL, U_THRUST, U_YAW, Array

WINDOW_S: Final = 0.6
"""Over which the effect of pitch, roll and yaw is measured."""
LEAST_STICK: Final = 0.6
"""Mean stick of a window that counts, as a share of its range to that side."""
REVERSED_EFFECT: Final = -0.3
FULL_THRUST_SHARE: Final = 0.98
"""Share of the largest thrust that counts as its limit."""

AXES: Final = ((U_PITCH, "pitch"), (U_ROLL, "roll"), (U_YAW, "yaw"))
"""Whose effects are told, in the order in which they are."""


@dataclass(frozen=True, slots=True)
class HoverThrustLimits:
    """Hover thrust, learnt in flight, at which the battery counts as empty; shares of the largest thrust.

    Raises
    ------
    ValueError
        Not in order, or not above 0 and at most 1.
    """

    warn_at: float = 0.8
    land_at: float = 0.88

    def __post_init__(self) -> None:
        if not 0.0 < self.warn_at <= self.land_at <= 1.0:
            raise ValueError(f"must be in order, above 0 and at most 1, got {self.warn_at}, {self.land_at}")


DEFAULT_LIMITS: Final = HoverThrustLimits()
"""Unless a fleet file says otherwise."""


@dataclass(frozen=True, slots=True)
class VehicleFault:
    """Why a vehicle has to land.

    Attributes
    ----------
    kind
        For counting: `thrust_exhausted`, `thrust_lost`, `battery_empty`, `axis_dead`, `axis_reversed`.
    text
        For people.
    axis
        Stick that is better left alone; None if all sticks work.
    """

    kind: str
    text: str
    axis: int | None = None


class VehicleWatch:
    """Watches one vehicle in flight.

    Parameters
    ----------
    model
        What its sticks should do.
    limits
        When its battery counts as empty.
    period_s
        Control period.
    """

    def __init__(self, model: Model, limits: HoverThrustLimits, period_s: float) -> None:
        self._limits = limits
        self._period_s = period_s
        self._under_way: deque[Array] = deque(maxlen=1 + round(model.delay_s / period_s))
        self._memory: Array = np.zeros((5, INPUT_SIZE))
        self._memory[3:] = np.inf
        self._periods = 0
        poles = [math.exp(-period_s / lag_s) if lag_s > 0.0 else 0.0 for lag_s in model.lag_s]
        self._vehicle = np.array((*model.input_gain, *model.damping, *poles, model.gravity_m_s2))
        largest = float(model.u_max[U_THRUST])
        hover_gain = float(model.hover_input[U_THRUST]) / largest
        rules = FULL_THRUST_SHARE * largest, hover_gain, limits.land_at
        self._rules: Array = np.array(rules).reshape(RULES)
        self._known: Array = np.zeros(KNOWN)
        # A side of the range to which a stick hardly moves says nothing about it.
        below, above = model.hover_input - model.u_min, model.u_max - model.hover_input
        least = LEAST_STICK * np.stack((below, above))
        self._least: Array = np.concatenate((least, WINDOW_S * np.array(model.input_gain) * least))
        self._back = round(WINDOW_S / period_s)
        self._moments: Array = np.empty((1 + round(THRUST_WINDOW_S / period_s), 2 * INPUT_SIZE + 2))
        self.begin()

    def begin(self) -> None:
        """Begin a flight: the battery may be another one."""
        self._known[:] = 0.0
        self._known[HOVER_THRUST] = self._known[LEARNT_GAIN] = math.nan
        self.forget()

    def forget(self) -> None:
        """Begin new windows, as what is known of the motion has a gap."""
        if self._periods == 0:
            return
        self._under_way.clear()
        self._periods = 0
        self._memory[:3], self._memory[3:] = 0.0, np.inf
        self._known[SUSPECT_S : FULL_FOR_S + 1] = 0.0

    @property
    def hover_thrust(self) -> float | None:
        """Share of the largest thrust that carries the vehicle now, filtered; None until it is known."""
        known = float(self._known[HOVER_THRUST])
        return None if math.isnan(known) else known

    @property
    def warning(self) -> str:
        """What is to be told before anything has to land; empty for nothing."""
        hover_thrust = self.hover_thrust
        if hover_thrust is None or hover_thrust < self._limits.warn_at:
            return ""
        return (
            f"the battery is nearly empty: it hovers at {hover_thrust:.2f} of the thrust and lands at "
            f"{self._limits.land_at:g}"
        )

    def observe(self, command: Array, motion: Array) -> VehicleFault | None:
        """Take in a control period of free flight.

        Parameters
        ----------
        command
            Sticks commanded in it, shape (4,).
        motion
            Estimated motion state at its beginning, shape (8,).

        Returns
        -------
        VehicleFault or None
            What is wrong, as soon as it is certain.
        """
        self._under_way.append(command)
        found = watch_effects(
            self._vehicle,
            self._least,
            command,
            self._under_way[0],
            motion,
            self._period_s,
            self._memory,
            self._moments,
            self._periods,
            self._back,
            self._rules,
            self._known,
        )
        self._periods += 1
        return None if found == SOUND else self._fault(found)

    def _fault(self, found: int) -> VehicleFault:
        """What was found, in words."""
        known = self._known
        if found == THRUST_EXHAUSTED:
            text = f"thrust at its limit for {THRUST_WINDOW_S:g} s without gaining height"
            return VehicleFault("thrust_exhausted", text)
        if found == THRUST_LOST:
            lost = 100.0 * (1.0 - known[GAIN] / known[LEARNT_GAIN])
            return VehicleFault("thrust_lost", f"the thrust has fallen by {lost:.0f} % in this flight")
        if found == BATTERY_EMPTY:
            text = f"the battery is empty: it hovers at {known[HOVER_THRUST]:.2f} of the thrust"
            return VehicleFault("battery_empty", text)
        place = found - AXIS_AT_FAULT
        axis, name = AXES[place]
        if known[EFFECT + place] < REVERSED_EFFECT:
            return VehicleFault("axis_reversed", f"{name} acts the wrong way round", axis)
        return VehicleFault("axis_dead", f"{name} has no effect", axis)
