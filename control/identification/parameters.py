"""Parameters of a fit with their prior spreads."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from rcopterx.control.identification.motions import Offsets
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_PITCH, U_ROLL, U_THRUST, U_YAW
from rcopterx.vehicles.tilt import TiltModel


@dataclass(frozen=True)
class Candidate:
    """Model and offsets that a fit supposes."""

    model: Model
    offsets: Offsets = field(default_factory=Offsets)


@dataclass(frozen=True)
class Parameter:
    """One number of a candidate.

    Attributes
    ----------
    spread
        Standard deviation among vehicles of a type: of the logarithm if `positive`, else of the number.
    read, write
        Return the number; return the candidate with another number.
    """

    name: str
    unit: str
    spread: float
    positive: bool
    read: Callable[[Candidate], float]
    write: Callable[[Candidate, float], Candidate]


def _tilt(name: str, of: str, unit: str, spread: float, positive: bool = True) -> Parameter:
    def read(candidate: Candidate) -> float:
        return float(getattr(_tilt_of(candidate), of))

    def write(candidate: Candidate, value: float) -> Candidate:
        tilt = replace(_tilt_of(candidate), **{of: value})
        return replace(candidate, model=replace(candidate.model, tilt=tilt))

    return Parameter(name, unit, spread, positive, read, write)


def _with_model(candidate: Candidate, changes: Mapping[str, Any]) -> Candidate:
    return replace(candidate, model=replace(candidate.model, **changes))


def _tilt_of(candidate: Candidate) -> TiltModel:
    tilt = candidate.model.tilt
    assert tilt is not None
    return tilt


def _of_four(name: str, of: str, axis: int, unit: str, spread: float, sign: float = 1.0) -> Parameter:
    def read(candidate: Candidate) -> float:
        return sign * float(getattr(candidate.model, of)[axis])

    def write(candidate: Candidate, value: float) -> Candidate:
        four = list(getattr(candidate.model, of))
        four[axis] = sign * value
        return _with_model(candidate, {of: tuple(four)})

    return Parameter(name, unit, spread, True, read, write)


def _of_both(name: str, of: str, unit: str, spread: float, sign: float) -> Parameter:
    """Mean of the pitch and the roll axis, whose ratio stays."""

    def read(candidate: Candidate) -> float:
        return 0.5 * sign * float(sum(getattr(candidate.model, of)[:2]))

    def write(candidate: Candidate, value: float) -> Candidate:
        four = getattr(candidate.model, of)
        factor = value / read(candidate)
        scaled = (four[0] * factor, four[1] * factor, *four[2:])
        return _with_model(candidate, {of: scaled})

    return Parameter(name, unit, spread, True, read, write)


def _offset(name: str, of: str, axis: int, unit: str, spread: float) -> Parameter:
    def read(candidate: Candidate) -> float:
        return float(getattr(candidate.offsets, of)[axis])

    def write(candidate: Candidate, value: float) -> Candidate:
        two = list(getattr(candidate.offsets, of))
        two[axis] = value
        return replace(candidate, offsets=replace(candidate.offsets, **{of: tuple(two)}))

    return Parameter(name, unit, spread, False, read, write)


def _delay() -> Parameter:
    return Parameter(
        "transport delay",
        "s",
        0.01,
        False,
        lambda candidate: candidate.model.delay_s,
        lambda candidate, value: replace(candidate, model=replace(candidate.model, delay_s=max(value, 0.0))),
    )


PITCH_GAIN: Final = _of_four("pitch gain", "input_gain", U_PITCH, "m/s^2", 0.25)
ROLL_GAIN: Final = _of_four("roll gain", "input_gain", U_ROLL, "m/s^2", 0.25)
THRUST_GAIN: Final = _of_four("thrust gain", "input_gain", U_THRUST, "m/s^2", 0.15)
YAW_GAIN: Final = _of_four("yaw gain", "input_gain", U_YAW, "rad/s^2", 0.3)
FREQUENCY: Final = _tilt("tilt frequency", "frequency_rad_s", "rad/s", 0.25)

_HORIZONTAL: Final = (PITCH_GAIN, ROLL_GAIN, _of_both("drag", "damping", "1/s", 0.4, -1.0), _delay())
_TRIM: Final = (
    _offset("pitch trim", "trim", 0, "", 0.03),
    _offset("roll trim", "trim", 1, "", 0.03),
)
_LAG: Final = (_of_both("lag of pitch and roll", "lag_s", "s", 0.4, 1.0),)
_TILT: Final = (
    FREQUENCY,
    _tilt("tilt damping", "damping_ratio", "", 0.7),
    _tilt("servo lag", "servo_lag_s", "s", 0.3),
    _tilt("upper phase", "upper_phase_rad", "rad", 0.1, positive=False),
    _tilt("lower phase", "lower_phase_rad", "rad", 0.1, positive=False),
    _tilt("upper share", "upper_share", "", 0.15),
    _tilt("direct lift", "direct_m", "m", 0.2),
)
_PLAIN_TILT: Final = _TILT[:3]
_BAR: Final = (_tilt("bar time constant", "bar_time_constant_s", "s", 0.3),)
_BODY: Final = (
    _offset("body offset forward", "body_rad", 0, "rad", 0.05),
    _offset("body offset left", "body_rad", 1, "rad", 0.05),
)

VERTICAL: Final = (THRUST_GAIN, _of_four("thrust lag", "lag_s", U_THRUST, "s", 0.4))
_HEADING: Final = (
    YAW_GAIN,
    _of_four("yaw damping", "damping", U_YAW, "1/s", 0.25, -1.0),
    _of_four("yaw lag", "lag_s", U_YAW, "s", 0.3),
)
_COUPLING: Final = Parameter(
    "thrust coupling",
    "",
    1.0,
    False,
    lambda candidate: candidate.model.thrust_coupling,
    lambda candidate, value: _with_model(candidate, {"thrust_coupling": value}),
)


def heading_parameters(model: Model) -> tuple[Parameter, ...]:
    """Return the parameters of the heading of a model."""
    return (*_HEADING, _COUPLING) if model.yaw_gyro else _HEADING


def horizontal_parameters(model: Model, with_tilt: bool) -> tuple[Parameter, ...]:
    """Return the parameters of the horizontal motion of a model, with or without measured tilt."""
    if model.tilt is None:
        return (*_HORIZONTAL, *_LAG, *_TRIM)
    bar = model.tilt.bar_time_constant_s is not None
    return (
        *_HORIZONTAL,
        *(_TILT if bar else _PLAIN_TILT),
        *(_BAR if bar else ()),
        *_TRIM,
        *(_BODY if with_tilt else ()),
    )
