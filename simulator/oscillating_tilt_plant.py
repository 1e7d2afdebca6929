"""A vehicle without a stabilizer bar whose tilt answers the stick as a damped oscillator.

Seen from the sticks, a helicopter with a flybarless head and a quadrotor under its attitude loop are like
this.
"""

import cmath
import math
from dataclasses import dataclass

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.first_order_plant import FirstOrderPlant
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.tuples import Four

Two = tuple[float, float]


@dataclass(frozen=True)
class TiltOscillator:
    """Response of the tilt to pitch and roll stick: theta'' = w^2 (stick - theta) - 2 zeta w theta'.

    Raises `ValueError` for a number out of its range; the message begins with its name.
    """

    frequency_rad_s: float
    """Natural frequency w."""
    damping_ratio: float
    """zeta, above 0."""

    def __post_init__(self) -> None:
        for name, largest in (("frequency_rad_s", 100.0), ("damping_ratio", 2.0)):
            value = getattr(self, name)
            if not 0.0 < value <= largest:
                raise ValueError(f"{name}: must be above 0 and at most {largest:g}, got {value}")


class OscillatingTiltPlant(FirstOrderPlant):
    """A `FirstOrderPlant` with an oscillator in place of the lags of pitch and roll."""

    def __init__(
        self, name: str, model: Model, conditions: Conditions, seed: int, start: Pose,
        oscillator: TiltOscillator,
    ) -> None:  # fmt: skip
        self._oscillator = oscillator
        super().__init__(name, model, conditions, seed, start)

    def _rest(self, pose: Pose) -> None:
        super()._rest(pose)
        self._swing = (0.0, 0.0)
        """Rates of pitch and roll, per second of a full stick's tilt."""

    def _actuate(self, step_s: float) -> Four:
        """Advance oscillators and lags by a substep; returns where they were in its middle."""
        (pitch, roll, _, _), (pitch_rate, roll_rate) = self._actuator, self._swing
        *_, thrust, yaw = super()._actuate(step_s)
        to_pitch, to_roll = self._target[:2]
        half, full = _transition(self._oscillator, 0.5 * step_s), _transition(self._oscillator, step_s)
        middle_pitch, _ = _moved(half, pitch, pitch_rate, to_pitch)
        middle_roll, _ = _moved(half, roll, roll_rate, to_roll)
        pitch, pitch_rate = _moved(full, pitch, pitch_rate, to_pitch)
        roll, roll_rate = _moved(full, roll, roll_rate, to_roll)
        self._actuator, self._swing = (pitch, roll, *self._actuator[2:]), (pitch_rate, roll_rate)
        return middle_pitch, middle_roll, thrust, yaw


def _transition(oscillator: TiltOscillator, time_s: float) -> Four:
    """How far from its target, and how fast, an oscillator is after a time; row by row."""
    w, zeta = oscillator.frequency_rad_s, oscillator.damping_ratio
    decay, swing = math.exp(-zeta * w * time_s), w * cmath.sqrt(zeta * zeta - 1.0)
    even = decay * cmath.cosh(swing * time_s).real
    odd = decay * ((cmath.sinh(swing * time_s) / swing).real if swing else time_s)
    return even + zeta * w * odd, odd, -w * w * odd, even - zeta * w * odd


def _moved(transition: Four, value: float, rate: float, target: float) -> Two:
    a, b, c, d = transition
    away = value - target
    return target + a * away + b * rate, c * away + d * rate
