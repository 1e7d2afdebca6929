"""Normalised inputs u to pulse widths and back (docs/hardware.md)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from rcopterx.radios.protocol import AILERON, CENTER_US, ELEVATOR, RUDDER, THROTTLE

PULSE_LOW_US, PULSE_HIGH_US = 800.0, 2200.0
LARGEST_INDEX = 15


class CalibrationError(ValueError):
    """A calibration value that makes no sense; the message names the field."""


def _check(condition: bool, field_name: str, value: object, allowed: str) -> None:
    if not condition:
        raise CalibrationError(f"{field_name}: {value} is not allowed, {allowed}")


def _check_pulse(field_name: str, value: float) -> None:
    allowed = f"a pulse width between {PULSE_LOW_US:g} and {PULSE_HIGH_US:g} us is"
    _check(math.isfinite(value) and PULSE_LOW_US <= value <= PULSE_HIGH_US, field_name, value, allowed)


def _check_index_and_slew(index: int, slew_per_s: float) -> None:
    _check(0 <= index <= LARGEST_INDEX, "index", index, f"0 to {LARGEST_INDEX} is")
    _check(math.isfinite(slew_per_s) and slew_per_s > 0, "slew_per_s", slew_per_s, "a positive number is")


@dataclass(frozen=True, slots=True)
class ChannelCalibration:
    """Pulse width of a cyclic or yaw channel: ``clamp(center + trim + sign gain u, lo, hi)``."""

    index: int
    """Channel, 0 throttle, 1 aileron, 2 elevator, 3 rudder, ..."""
    sign: int = 1
    """Direction of the channel."""
    center_us: float = CENTER_US
    trim_us: float = 0.0
    """`center_us`, `trim_us`: neutral pulse width and its correction."""
    gain_us: float = 400.0
    """Pulse width per unit of input."""
    lo_us: float = 1100.0
    hi_us: float = 1900.0
    """`lo_us`, `hi_us`: limits of the pulse width."""
    slew_per_s: float = 20.0
    """Fastest change of the input."""

    def __post_init__(self) -> None:
        _check_index_and_slew(self.index, self.slew_per_s)
        _check(self.sign in (1, -1), "sign", self.sign, "1 or -1 is")
        for name in ("center_us", "lo_us", "hi_us"):
            _check_pulse(name, getattr(self, name))
        _check(
            math.isfinite(self.gain_us) and self.gain_us > 0, "gain_us", self.gain_us, "a positive number is"
        )
        _check(self.lo_us < self.hi_us, "lo_us", self.lo_us, f"less than hi_us = {self.hi_us:g} is")
        neutral = self.center_us + self.trim_us
        allowed = f"center_us + trim_us between {self.lo_us:g} and {self.hi_us:g} us is"
        _check(self.lo_us <= neutral <= self.hi_us, "trim_us", self.trim_us, allowed)

    def pulse_us(self, u: float) -> float:
        """Pulse width [us] of the input `u`."""
        pulse = self.center_us + self.trim_us + self.sign * self.gain_us * u
        return min(max(pulse, self.lo_us), self.hi_us)

    def stick_input(self, pulse_us: float) -> float:
        """Input that gives `pulse_us`, without the limits."""
        return (pulse_us - self.center_us - self.trim_us) / (self.sign * self.gain_us)

    def trimmed(self, mean_u: float) -> "ChannelCalibration":
        """Calibration whose neutral is where a hover needed the mean input `mean_u`."""
        return replace(self, trim_us=self.trim_us + self.sign * self.gain_us * mean_u)


@dataclass(frozen=True, slots=True)
class ThrottleCalibration:
    """Pulse width of the throttle, linear between three measured points."""

    index: int = THROTTLE
    us0: float = 1100.0
    us_hover: float = 1540.0
    us1: float = 1900.0
    """`us0`, `us_hover`, `us1`: pulse widths [us] at thrust 0, `u_hover` and 1."""
    u_hover: float = 0.55
    """Thrust at which the model hovers."""
    low_us: float = 1100.0
    """Throttle low, sent when the motors must stop; free of any trim, so not above `us0`."""
    slew_per_s: float = 4.0
    """`index`, `slew_per_s`: as for the other channels."""

    def __post_init__(self) -> None:
        _check_index_and_slew(self.index, self.slew_per_s)
        for name in ("us0", "us_hover", "us1", "low_us"):
            _check_pulse(name, getattr(self, name))
        _check(0 < self.u_hover < 1, "u_hover", self.u_hover, "a thrust between 0 and 1 is")
        allowed = f"a value between us0 = {self.us0:g} and us1 = {self.us1:g} is"
        _check(self.us0 < self.us_hover < self.us1, "us_hover", self.us_hover, allowed)
        _check(self.low_us <= self.us0, "low_us", self.low_us, f"at most us0 = {self.us0:g} is")

    def pulse_us(self, u: float) -> float:
        """Pulse width [us] of the thrust `u`, limited to 0..1."""
        thrust = min(max(u, 0.0), 1.0)
        if thrust <= self.u_hover:
            return self.us0 + (self.us_hover - self.us0) * thrust / self.u_hover
        return self.us_hover + (self.us1 - self.us_hover) * (thrust - self.u_hover) / (1 - self.u_hover)

    def stick_input(self, pulse_us: float) -> float:
        """Thrust that gives `pulse_us`, 0 below `us0` and 1 above `us1`."""
        pulse = min(max(pulse_us, self.us0), self.us1)
        if pulse <= self.us_hover:
            return self.u_hover * (pulse - self.us0) / (self.us_hover - self.us0)
        return self.u_hover + (1 - self.u_hover) * (pulse - self.us_hover) / (self.us1 - self.us_hover)


@dataclass(frozen=True, slots=True)
class SwitchChannel:
    """A channel with two positions."""

    index: int
    """Channel, 0 throttle, 1 aileron, 2 elevator, 3 rudder, 4 gear, ..."""
    on_us: float = 1900.0
    off_us: float = 1100.0
    """`on_us`, `off_us`: pulse widths of the positions."""

    def __post_init__(self) -> None:
        _check(0 <= self.index <= LARGEST_INDEX, "index", self.index, f"0 to {LARGEST_INDEX} is")
        _check_pulse("on_us", self.on_us)
        _check_pulse("off_us", self.off_us)
        _check(self.on_us != self.off_us, "on_us", self.on_us, f"not off_us = {self.off_us:g} is")

    def is_on(self, pulses_us: Sequence[float]) -> bool:
        """Whether the vehicle's electronics find it on; channels that are not received are off."""
        if self.index >= len(pulses_us):
            return False
        return abs(pulses_us[self.index] - self.on_us) < abs(pulses_us[self.index] - self.off_us)


@dataclass(frozen=True, slots=True)
class ArmingChannel(SwitchChannel):
    """The channel that arms: on while the vehicle is flown."""

    low_s: float = 0.1
    """For so long the throttle is low before it comes on, and afterwards."""

    def __post_init__(self) -> None:
        # A class with slots is made anew, so that super() without arguments would not find it.
        SwitchChannel.__post_init__(self)
        _check(0 <= self.low_s <= 2, "low_s", self.low_s, "a time from 0 to 2 s is")


@dataclass(frozen=True, slots=True)
class Calibration:
    """All channels of one vehicle; inputs are ordered u = (u_x pitch, u_y roll, u_z thrust, u_psi yaw).

    Raises `CalibrationError` for two inputs on one channel.
    """

    pitch: ChannelCalibration = field(default_factory=lambda: ChannelCalibration(ELEVATOR))
    """Channel of u_x."""
    roll: ChannelCalibration = field(default_factory=lambda: ChannelCalibration(AILERON))
    """Channel of u_y."""
    throttle: ThrottleCalibration = field(default_factory=ThrottleCalibration)
    """Channel of u_z."""
    yaw: ChannelCalibration = field(default_factory=lambda: ChannelCalibration(RUDDER, slew_per_s=8.0))
    """Channel of u_psi."""
    arming: ArmingChannel | None = None
    """Channel that arms a flight controller; None where low throttle is all that stops the motors."""
    emergency: SwitchChannel | None = None
    """Channel that stops the motors at once; on after a kill."""
    rest_us: float = CENTER_US
    """Pulse width of all other channels."""

    def __post_init__(self) -> None:
        _check_pulse("rest_us", self.rest_us)
        taken: dict[int, str] = {}
        for name in ("pitch", "roll", "throttle", "yaw", "arming", "emergency"):
            channel = getattr(self, name)
            if channel is None:
                continue
            if (index := channel.index) in taken:
                raise CalibrationError(f"{name}.index: channel {index} is already used by {taken[index]}")
            taken[index] = name

    @property
    def slew_per_s(self) -> tuple[float, float, float, float]:
        """Fastest change of each input [1/s]."""
        return (self.pitch.slew_per_s, self.roll.slew_per_s, self.throttle.slew_per_s, self.yaw.slew_per_s)

    def pulses_us(
        self, u: Sequence[float], *, throttle_low: bool = False, armed: bool = False, stopped: bool = False
    ) -> tuple[float, ...]:
        """Pulse widths [us] of the channels up to the last used one, for u (4,) and switches as stated."""
        pulses = {
            self.pitch.index: self.pitch.pulse_us(u[0]),
            self.roll.index: self.roll.pulse_us(u[1]),
            self.throttle.index: self.throttle.low_us if throttle_low else self.throttle.pulse_us(u[2]),
            self.yaw.index: self.yaw.pulse_us(u[3]),
        }
        for channel, on in ((self.arming, armed), (self.emergency, stopped)):
            if channel is not None:
                pulses[channel.index] = channel.on_us if on else channel.off_us
        return tuple([pulses.get(index, self.rest_us) for index in range(max(pulses) + 1)])

    def inputs(self, pulses_us: Sequence[float]) -> tuple[float, float, float, float]:
        """Inputs as the vehicle's electronics see them: the inverse of `pulses_us` without limits."""
        return (
            self.pitch.stick_input(pulses_us[self.pitch.index]),
            self.roll.stick_input(pulses_us[self.roll.index]),
            self.throttle.stick_input(pulses_us[self.throttle.index]),
            self.yaw.stick_input(pulses_us[self.yaw.index]),
        )

    def trimmed(self, mean_u: Sequence[float]) -> "Calibration":
        """Calibration with new trims from the mean inputs of a steady hover, or `CalibrationError`."""
        trimmed: dict[str, ChannelCalibration] = {}
        for name, mean in (("pitch", mean_u[0]), ("roll", mean_u[1]), ("yaw", mean_u[3])):
            channel: ChannelCalibration = getattr(self, name)
            try:
                trimmed[name] = channel.trimmed(mean)
            except CalibrationError as error:
                raise CalibrationError(f"{name}.{error}") from None
        return replace(self, pitch=trimmed["pitch"], roll=trimmed["roll"], yaw=trimmed["yaw"])
