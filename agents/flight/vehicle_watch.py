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

from rcopterx.native.motion import watch_effects
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_PITCH, U_ROLL, U_THRUST, U_YAW, Array

WINDOW_S: Final = 0.6
"""Over which the effect of pitch, roll and yaw is measured."""
LEAST_STICK: Final = 0.6
"""Mean stick of a window that counts, as a share of its range to that side."""
DEAD_EFFECT: Final = 0.15
"""An axis with less than this has none."""
REVERSED_EFFECT: Final = -0.3
AXIS_PATIENCE_S: Final = 0.3
"""How long windows have to agree about an axis."""

SWING_S: Final = 2.5
"""A stick that was as far on the other side so shortly before swings."""
MOST_TURNED_RAD: Final = 0.5
"""A rotor's tilt stays behind the heading, so windows that turn further say nothing of pitch and roll."""

THRUST_WINDOW_S: Final = 1.0
FULL_THRUST: Final = 0.98
"""Share of the largest thrust that counts as its limit."""
LEAST_CLIMB_M: Final = 0.1
"""Height that full thrust gains within its window at least."""
LEARNING_S: Final = 3.0
"""First seconds of a flight, in which its thrust gain is learnt."""
LEAST_GAIN: Final = 0.7
"""Share of the learnt thrust gain below which the rotor counts as weak..."""
SUDDEN: Final = 0.9
"""...if it is also less than this share of the gain of the last seconds: a battery takes its time."""
BATTERY_TIME_S: Final = 5.0
"""Time constant of the hover thrust, which a battery changes slowly."""

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
        self._model = model
        self._limits = limits
        self._period_s = period_s
        self._delay = round(model.delay_s / period_s)
        poles = [math.exp(-period_s / lag_s) if lag_s > 0.0 else 0.0 for lag_s in model.lag_s]
        self._vehicle = np.array((*model.input_gain, *model.damping, *poles, model.gravity_m_s2))
        self._full_thrust = FULL_THRUST * float(model.u_max[U_THRUST])
        # Hover thrust of the model, as a share of the largest one.
        self._hover_gain = float(model.hover_input[U_THRUST]) / float(model.u_max[U_THRUST])
        # A side of the range to which a stick hardly moves says nothing about it.
        below, above = model.hover_input - model.u_min, model.u_max - model.hover_input
        least = LEAST_STICK * np.stack((below, above))
        self._least: Array = np.concatenate((least, WINDOW_S * np.array(model.input_gain) * least))
        self._back = round(WINDOW_S / period_s)
        self._thrust_periods = round(THRUST_WINDOW_S / period_s)
        self._moments: Array = np.empty((1 + self._thrust_periods, 2 * INPUT_SIZE + 2))
        self._told: Array = np.empty(6)
        self.begin()

    def begin(self) -> None:
        """Begin a flight: the battery may be another one."""
        self.hover_thrust: float | None = None
        """Thrust that carries the vehicle now, filtered; None until it is known."""
        self._learnt_gain: float | None = None
        self._learning_s = 0.0
        self.forget()

    def forget(self) -> None:
        """Begin new windows, as what is known of the motion has a gap."""
        self._under_way: deque[Array] = deque(maxlen=self._delay + 1)
        self._periods = 0
        self._memory: Array = np.zeros((5, INPUT_SIZE))
        self._memory[3:] = np.inf
        self._full_for_s = 0.0
        self._suspect_s = [0.0] * len(AXES)

    @property
    def warning(self) -> str:
        """What is to be told before anything has to land; empty for nothing."""
        if self.hover_thrust is None or self.hover_thrust < self._limits.warn_at:
            return ""
        return (
            f"the battery is nearly empty: it hovers at {self.hover_thrust:.2f} of the thrust and lands at "
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
        arrived = self._under_way[0]
        if not self._periods:
            self._memory[0] = arrived
        watch_effects(
            self._vehicle,
            self._least,
            arrived,
            motion,
            self._period_s,
            self._memory,
            self._moments,
            self._periods,
            self._back,
            SWING_S,
            MOST_TURNED_RAD,
            self._told,
        )
        pitch, roll, yaw, climbed_m, asked_m_s, made_m_s = self._told.tolist()
        if self._periods >= self._thrust_periods:
            fault = self._thrust_fault(float(command[U_THRUST]), climbed_m, asked_m_s, made_m_s)
            if fault is not None:
                return fault
        self._periods += 1
        return self._axis_fault((pitch, roll, yaw))

    def _thrust_fault(
        self, thrust: float, climbed_m: float, asked_m_s: float, made_m_s: float
    ) -> VehicleFault | None:
        full = thrust >= self._full_thrust
        self._full_for_s = self._full_for_s + self._period_s if full else 0.0
        if self._full_for_s >= THRUST_WINDOW_S and climbed_m < LEAST_CLIMB_M:
            text = f"thrust at its limit for {THRUST_WINDOW_S:g} s without gaining height"
            return VehicleFault("thrust_exhausted", text)
        if asked_m_s <= 0.5 * THRUST_WINDOW_S * self._model.gravity_m_s2:
            return None  # It falls on purpose: nothing can be told from so little thrust.
        gain = made_m_s / asked_m_s
        self._learn(gain)
        if self._learning_s < LEARNING_S or self._learnt_gain is None or self.hover_thrust is None:
            return None
        recent_gain = self._hover_gain / self.hover_thrust
        if gain < LEAST_GAIN * self._learnt_gain and gain < SUDDEN * recent_gain:
            lost = 100.0 * (1.0 - gain / self._learnt_gain)
            return VehicleFault("thrust_lost", f"the thrust has fallen by {lost:.0f} % in this flight")
        if self.hover_thrust > self._limits.land_at:
            text = f"the battery is empty: it hovers at {self.hover_thrust:.2f} of the thrust"
            return VehicleFault("battery_empty", text)
        return None

    def _learn(self, gain: float) -> None:
        hover = self._hover_gain / max(gain, 0.05)
        if self.hover_thrust is None or self._learnt_gain is None:
            self.hover_thrust, self._learnt_gain = hover, gain
            return
        share = self._period_s / (self._period_s + BATTERY_TIME_S)
        self.hover_thrust += share * (hover - self.hover_thrust)
        if self._learning_s < LEARNING_S:
            self._learning_s += self._period_s
            self._learnt_gain += self._period_s / self._learning_s * (gain - self._learnt_gain)

    def _axis_fault(self, effects: tuple[float, float, float]) -> VehicleFault | None:
        for place, effect in enumerate(effects):
            self._suspect_s[place] = self._suspect_s[place] + self._period_s if effect < DEAD_EFFECT else 0.0
        if max(self._suspect_s) < AXIS_PATIENCE_S:
            return None
        place = next(place for place, time_s in enumerate(self._suspect_s) if time_s >= AXIS_PATIENCE_S)
        axis, name = AXES[place]
        if effects[place] < REVERSED_EFFECT:
            return VehicleFault("axis_reversed", f"{name} acts the wrong way round", axis)
        return VehicleFault("axis_dead", f"{name} has no effect", axis)
