"""Detection of faults of a vehicle: weak rotor, empty battery, an axis that does not follow its stick.

What a stick should have done within a window is compared with what the vehicle did. For each axis the model
says

    velocity' = gain * (stick after delay and lag) + damping * velocity + turning of the frame - gravity

so the change of the velocity, less damping, turning and gravity, is what the stick has done. Its ratio to
the model is the effect of the axis: 1 as modelled, 0 for a dead axis, negative for a reversed one. Wind adds
to it, so only windows with large sticks count. A stick that swings from side to side does not count: a
vehicle that oscillates responds late and is not broken.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_PITCH, U_ROLL, U_THRUST, U_YAW, Array

WINDOW_S: Final = 0.6  # window of the effects of pitch, roll and yaw
LEAST_STICK: Final = 0.6  # mean stick of a window that counts, as a share of its range to that side
DEAD_EFFECT: Final = 0.15
REVERSED_EFFECT: Final = -0.3
AXIS_PATIENCE_S: Final = 0.3  # how long the effect of an axis has to stay below `DEAD_EFFECT`
SWING_S: Final = 2.5  # a stick that was as far on the other side within this time swings
MOST_TURNED_RAD: Final = 0.5  # a larger turn in a window: the tilt stays behind the heading
AS_MODELLED: Final = 1.0

THRUST_WINDOW_S: Final = 1.0
FULL_THRUST_SHARE: Final = 0.98  # share of the largest thrust that counts as its limit
LEAST_CLIMB_M: Final = 0.1  # height that full thrust gains within its window at least
LEARNING_S: Final = 3.0  # first seconds of a flight, in which the gain of the thrust is learnt
LEAST_GAIN: Final = 0.7  # share of the learnt gain below which the rotor counts as weak
SUDDEN: Final = 0.9  # ...if also below this share of the last seconds' gain: batteries discharge slowly
BATTERY_TIME_S: Final = 5.0  # time constant of the filter of the hover thrust

AXES: Final = ((U_PITCH, "pitch"), (U_ROLL, "roll"), (U_YAW, "yaw"))
"""Axes whose effects are judged, in this order."""


@dataclass(frozen=True, slots=True)
class HoverThrustLimits:
    """Shares of the largest thrust whose hover shows a nearly empty and an empty battery, in this order."""

    warn_at: float = 0.8
    land_at: float = 0.88

    def __post_init__(self) -> None:
        if not 0.0 < self.warn_at <= self.land_at <= 1.0:
            raise ValueError(f"must be in order, above 0 and at most 1, got {self.warn_at}, {self.land_at}")


DEFAULT_LIMITS: Final = HoverThrustLimits()


@dataclass(frozen=True, slots=True)
class VehicleFault:
    """Reason why a vehicle has to land."""

    kind: str  # name under which it is counted
    text: str  # description for people
    axes: tuple[int, ...] = ()  # sticks that should rest from now on


class _Moment(NamedTuple):
    """Beginning of a control period."""

    velocities: list[tuple[float, float]]  # of each axis: what its stick demanded and what it made so far
    height_m: float
    yaw_rad: float


class VehicleWatch:
    """Watches one vehicle from take-off to landing."""

    def __init__(self, model: Model, limits: HoverThrustLimits, period_s: float) -> None:
        self.fault: VehicleFault | None = None  # why the vehicle lands, or has landed, by itself
        self.active = True  # whether the vehicle lands by itself
        self._limits, self._period_s, self._rest = limits, period_s, model.hover_input
        self._watched_at_s = 0.0
        self._sticks_under_way: deque[Array] = deque(maxlen=1 + round(model.delay_s / period_s))
        self._moments: deque[_Moment] = deque(maxlen=1 + round(THRUST_WINDOW_S / period_s))
        self._axes = [_StickEffect(model, axis, period_s) for axis in range(INPUT_SIZE)]
        self._thrust = _ThrustWatch(model, limits, period_s)
        self._back = round(WINDOW_S / period_s)
        self._gravity_m_s2 = model.gravity_m_s2

    def with_model(self, model: Model) -> "VehicleWatch":
        """Return the watch of a flight that continues with another model."""
        watch = VehicleWatch(model, self._limits, self._period_s)
        watch.active, watch.fault = self.active, self.fault
        return watch

    def begin(self) -> None:
        """Begin a flight, perhaps with another battery."""
        self.fault = None
        self._thrust.reset()
        self._forget()

    def _forget(self) -> None:
        """Begin new windows, because the observed motion has a gap."""
        self._sticks_under_way.clear()
        self._moments.clear()
        self._thrust.full_for_s = 0.0
        for axis in self._axes:
            axis.reset()

    @property
    def hover_thrust(self) -> float | None:
        """Share of the largest thrust that carries the vehicle now, filtered; None until it is known."""
        return self._thrust.hover_thrust

    @property
    def remark(self) -> str:
        """The fault, or a warning of a battery that will soon be empty, for people; empty without one."""
        if self.fault is not None:
            return f"it lands: {self.fault.text}"
        hover_thrust = self.hover_thrust
        if hover_thrust is None or hover_thrust < self._limits.warn_at:
            return ""
        return (
            f"the battery is nearly empty: it hovers at {hover_thrust:.2f} of the thrust and lands at "
            f"{self._limits.land_at:g}"
        )

    def observe(
        self, command: Array, motion: Array, time_s: float, informative: bool = True
    ) -> VehicleFault | None:
        """Process one period, of `command` (4,) and `motion` (8,) before it; return a certain fault, once."""
        gap_s, self._watched_at_s = time_s - self._watched_at_s, time_s
        if not (self.active and informative) or self.fault is not None or gap_s > 1.5 * self._period_s:
            self._forget()
            return None
        self.fault = self._judge(command, motion)
        return self.fault

    def without_broken_axes(self, inputs: Array) -> Array:
        """Return inputs, shape (k, 4), that leave broken axes at rest."""
        if self.fault is None or not self.fault.axes:
            return inputs
        kept = inputs.copy()
        rest = list(self.fault.axes)
        kept[:, rest] = self._rest[rest]
        return kept

    def _judge(self, command: Array, motion: Array) -> VehicleFault | None:
        self._sticks_under_way.append(command)
        moment = self._advance(self._sticks_under_way[0].tolist(), motion.tolist())
        moments = self._moments
        moments.append(moment)
        if len(moments) == moments.maxlen:
            fault = self._thrust.judge(moments[0], moment, float(command[U_THRUST]))
            if fault is not None:
                return fault
        first = moments[-1 - self._back] if len(moments) > self._back else None
        faults = [self._axes[axis].judge(first, moment, name) for axis, name in AXES]
        return next((fault for fault in faults if fault is not None), None)

    def _advance(self, sticks: list[float], motion: list[float]) -> _Moment:
        """Advance the model by one period; return the moment of its beginning."""
        _, _, height_m, yaw_rad, xd, yd, _, yaw_rate = motion
        frame = (yaw_rate * yd, -yaw_rate * xd, -self._gravity_m_s2, 0.0)
        velocities = list(map(_StickEffect.advance, self._axes, sticks, motion[4:], frame))
        return _Moment(velocities, height_m, yaw_rad)


def _change(first: _Moment, last: _Moment, axis: int) -> tuple[float, float]:
    """Changes of velocity between two moments that the stick of an axis demanded and made."""
    (demanded_first, made_first), (demanded, made) = first.velocities[axis], last.velocities[axis]
    return demanded - demanded_first, made - made_first


class _StickEffect:
    """What one stick should do to its velocity, and whether it does."""

    def __init__(self, model: Model, axis: int, period_s: float) -> None:
        self._axis, self._period_s = axis, period_s
        self._gain, self._damping, lag_s = model.input_gain[axis], model.damping[axis], model.lag_s[axis]
        self._pole = math.exp(-period_s / lag_s) if lag_s > 0.0 else 0.0
        below = model.hover_input[axis] - model.u_min[axis]
        above = model.u_max[axis] - model.hover_input[axis]
        # A side of the range to which a stick hardly moves shows nothing about it.
        self._far = (LEAST_STICK * float(below), LEAST_STICK * float(above))
        self._least_demanded = tuple(WINDOW_S * self._gain * far for far in self._far)
        self.reset()

    def reset(self) -> None:
        self._stick: float | None = None
        self._demanded = 0.0  # change of the velocity that the stick demanded so far
        self._passive = 0.0  # change of the velocity by damping, turning of the frame and gravity so far
        self._near_for_s = (math.inf, math.inf)  # time since the stick was far to its lower and upper side
        self._dead_for_s = 0.0

    def advance(self, stick: float, velocity: float, other: float) -> tuple[float, float]:
        """Advance by a period, under `stick` and the acceleration `other` of turning and gravity."""
        until_now = self._demanded, velocity - self._passive
        period_s, (far_below, far_above), (below_s, above_s) = self._period_s, self._far, self._near_for_s
        before = stick if self._stick is None else self._stick
        self._stick = acting = stick + self._pole * (before - stick)
        self._near_for_s = (
            0.0 if acting < -far_below else below_s + period_s,
            0.0 if acting > far_above else above_s + period_s,
        )
        self._demanded += period_s * self._gain * acting
        self._passive += period_s * (self._damping * velocity + other)
        return until_now

    def judge(self, first: _Moment | None, last: _Moment, name: str) -> VehicleFault | None:
        """Return a fault if the stick has had no effect, or a reversed one, for long enough."""
        effect = AS_MODELLED if first is None else self._effect(first, last)
        self._dead_for_s = self._dead_for_s + self._period_s if effect < DEAD_EFFECT else 0.0
        if self._dead_for_s < AXIS_PATIENCE_S:
            return None
        if effect < REVERSED_EFFECT:
            return VehicleFault("axis_reversed", f"{name} acts the wrong way round", (self._axis,))
        return VehicleFault("axis_dead", f"{name} has no effect", (self._axis,))

    def _effect(self, first: _Moment, last: _Moment) -> float:
        """Return what the stick has done in a window as a share of what it demanded."""
        axis = self._axis
        demanded, made = _change(first, last, axis)
        side = 1 if demanded > 0.0 else 0
        if abs(demanded) <= self._least_demanded[side] or self._near_for_s[1 - side] < SWING_S:
            return AS_MODELLED
        if axis != U_YAW and abs(last.yaw_rad - first.yaw_rad) > MOST_TURNED_RAD:
            return AS_MODELLED
        return made / demanded


class _ThrustWatch:
    """Whether the rotor and the battery still carry the vehicle."""

    def __init__(self, model: Model, limits: HoverThrustLimits, period_s: float) -> None:
        largest = float(model.u_max[U_THRUST])
        self._full_thrust = FULL_THRUST_SHARE * largest
        self._model_hover_thrust = float(model.hover_input[U_THRUST]) / largest
        self._land_at = limits.land_at
        self._gravity_m_s2, self._period_s = model.gravity_m_s2, period_s
        self.reset()

    def reset(self) -> None:
        self.hover_thrust: float | None = None
        self.full_for_s = 0.0  # for how long the thrust has been at its limit
        self._learnt_gain = math.nan
        self._learning_for_s = 0.0

    def judge(self, first: _Moment, last: _Moment, thrust: float) -> VehicleFault | None:
        """Return a fault that the window from `first` to `last` shows; `thrust` is the present stick."""
        self.full_for_s = self.full_for_s + self._period_s if thrust >= self._full_thrust else 0.0
        if self.full_for_s >= THRUST_WINDOW_S and last.height_m - first.height_m < LEAST_CLIMB_M:
            text = f"thrust at its limit for {THRUST_WINDOW_S:g} s without gaining height"
            return VehicleFault("thrust_exhausted", text)
        demanded_m_s, made_m_s = _change(first, last, U_THRUST)
        if demanded_m_s <= 0.5 * THRUST_WINDOW_S * self._gravity_m_s2:
            return None  # It falls on purpose: so little thrust shows nothing.
        gain = made_m_s / demanded_m_s
        hover_thrust = self._learn(gain)
        if self._learning_for_s < LEARNING_S:
            return None
        recent_gain = self._model_hover_thrust / hover_thrust
        if gain < LEAST_GAIN * self._learnt_gain and gain < SUDDEN * recent_gain:
            lost = 100.0 * (1.0 - gain / self._learnt_gain)
            return VehicleFault("thrust_lost", f"the thrust has fallen by {lost:.0f} % in this flight")
        if hover_thrust > self._land_at:
            text = f"the battery is empty: it hovers at {hover_thrust:.2f} of the thrust"
            return VehicleFault("battery_empty", text)
        return None

    def _learn(self, gain: float) -> float:
        """Update the learnt gain and the hover thrust by the gain of a window; return the hover thrust."""
        hover_thrust, period_s = self._model_hover_thrust / max(gain, 0.05), self._period_s
        if self.hover_thrust is None:
            self.hover_thrust, self._learnt_gain = hover_thrust, gain
            return hover_thrust
        self.hover_thrust += period_s / (period_s + BATTERY_TIME_S) * (hover_thrust - self.hover_thrust)
        if self._learning_for_s < LEARNING_S:
            self._learning_for_s += period_s
            self._learnt_gain += period_s / self._learning_for_s * (gain - self._learnt_gain)
        return self.hover_thrust
