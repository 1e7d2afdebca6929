"""Parameters of a fit with their prior spreads."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any, Final

from rcopterx.control.identification.motions import Candidate
from rcopterx.tables import table_beside
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_YAW


@dataclass(frozen=True)
class Parameter:
    """One number of a candidate."""

    name: str
    unit: str
    # standard deviation among vehicles of a type: of the logarithm if `positive`, else of the number
    spread: float
    positive: bool
    # return the number; return the candidate with another number
    read: Callable[[Candidate], float]
    write: Callable[[Candidate, float], Candidate]


def _number(
    name: str, path: str, unit: str, spread: float, index: int | None = None, positive: bool = True
) -> Parameter:
    """A number of a candidate, or one of a tuple of numbers, as in `model.tilt.servo_lag_s`."""
    found = attrgetter(path)

    def read(candidate: Candidate) -> float:
        value = found(candidate)
        return float(value if index is None else value[index])

    def write(candidate: Candidate, value: float) -> Candidate:
        new: Any = value
        if index is not None:
            new = tuple(new if at == index else other for at, other in enumerate(found(candidate)))
        written: Candidate = _replaced(candidate, path, new)
        return written

    return Parameter(name, unit, spread, positive, read, write)


def _replaced(record: Any, path: str, value: Any) -> Any:
    """Return a dataclass with another value of a field, which may be a field of a field."""
    first, _, rest = path.partition(".")
    return replace(record, **{first: _replaced(getattr(record, first), rest, value) if rest else value})


def _of_both(name: str, of: str, unit: str, spread: float, sign: float) -> Parameter:
    """Mean of the pitch and the roll axis, whose ratio stays."""

    def read(candidate: Candidate) -> float:
        return 0.5 * sign * float(sum(getattr(candidate.model, of)[:2]))

    def write(candidate: Candidate, value: float) -> Candidate:
        four = getattr(candidate.model, of)
        factor = value / read(candidate)
        scaled = (four[0] * factor, four[1] * factor, *four[2:])
        written: Candidate = _replaced(candidate, f"model.{of}", scaled)
        return written

    return Parameter(name, unit, spread, True, read, write)


def _with_delay(candidate: Candidate, delay_s: float) -> Candidate:
    return replace(candidate, model=replace(candidate.model, delay_s=max(delay_s, 0.0)))


def _with_slope(candidate: Candidate, gain: float) -> Candidate:
    """With another gain of the thrust around hover, whose stick stays."""
    model = candidate.model
    pitch, roll, before, yaw = model.input_gain
    balanced = model.gravity_m_s2 * gain / before
    model = replace(model, input_gain=(pitch, roll, gain, yaw), gravity_m_s2=balanced)
    return replace(candidate, model=model)


def _with_yaw_loop(candidate: Candidate, rate_rad_s: float, time_s: float) -> Candidate:
    """With a yaw rate per stick that is reached with a time constant."""
    model, damping = candidate.model, -1.0 / max(time_s, SHORTEST_YAW_S)
    model = replace(
        model,
        input_gain=(*model.input_gain[:U_YAW], -damping * rate_rad_s),
        damping=(*model.damping[:U_YAW], damping),
    )
    return replace(candidate, model=model)


def _yaw_time_s(candidate: Candidate) -> float:
    return 1.0 / max(-candidate.model.damping[U_YAW], 1.0 / LONGEST_YAW_S)


def _yaw_rate(candidate: Candidate) -> float:
    return candidate.model.input_gain[U_YAW] * _yaw_time_s(candidate)


SHORTEST_YAW_S: Final = 0.02  # the cascade's Euler steps of one period do not follow faster yaw rates
LONGEST_YAW_S: Final = 10.0  # time constant of a yaw rate without damping
_TABLE: Final = table_beside(__file__, "parameters")
_GROUPS: Final = {group: tuple(_number(**row) for row in rows) for group, rows in _TABLE.items()}
PITCH_GAIN, ROLL_GAIN, THRUST_GAIN = _GROUPS["gains"]
FREQUENCY, DAMPING, _ = _GROUPS["tilt"]

_DELAY: Final = Parameter(
    "transport delay", "s", 0.01, False, lambda candidate: candidate.model.delay_s, _with_delay
)
_HORIZONTAL: Final = (PITCH_GAIN, ROLL_GAIN, _of_both("drag", "damping", "1/s", 0.4, -1.0), _DELAY)
_LAG: Final = (_of_both("lag of pitch and roll", "lag_s", "s", 0.4, 1.0),)
_THRUST_LAG, _PER_VOLT = _GROUPS["thrust"]
_SLOPE: Final = replace(THRUST_GAIN, spread=0.3, write=_with_slope)
_YAW_LAG, _COUPLING = _GROUPS["yaw"]
YAW_RATE_GAIN: Final = Parameter(
    "yaw rate gain",
    "rad/s",
    0.3,
    True,
    _yaw_rate,
    lambda candidate, rate_rad_s: _with_yaw_loop(candidate, rate_rad_s, _yaw_time_s(candidate)),
)
_HEADING: Final = (
    YAW_RATE_GAIN,
    Parameter(
        "yaw time constant",
        "s",
        0.65,
        True,
        _yaw_time_s,
        lambda candidate, time_s: _with_yaw_loop(candidate, _yaw_rate(candidate), time_s),
    ),
    _YAW_LAG,
)


def vertical_parameters(logged: bool) -> tuple[Parameter, ...]:
    """Return the parameters of the height, in another form for a firmware that makes up for the battery."""
    return (_SLOPE, _THRUST_LAG, _PER_VOLT) if logged else (THRUST_GAIN, _THRUST_LAG)


def heading_parameters(model: Model) -> tuple[Parameter, ...]:
    """Return the parameters of the heading of a model."""
    found = _HEADING[1:] if model.sticks_known else _HEADING
    return (*found, _COUPLING) if model.yaw_gyro else found


def horizontal_parameters(model: Model, with_tilt: bool, with_lever: bool) -> tuple[Parameter, ...]:
    """Return the parameters of the horizontal motion of a model, perhaps with measured tilt and lever arm."""
    motion = _HORIZONTAL[2:] if model.sticks_known else _HORIZONTAL
    if model.tilt is None:
        return (*motion, *_LAG, *_GROUPS["trim"])
    return (
        *motion,
        *_GROUPS["tilt"],
        *(_GROUPS["bar"] if model.tilt.bar_time_constant_s is not None else ()),
        *(_GROUPS["flapping"] if model.tilt.flapping_rad_s_m else ()),
        *_GROUPS["trim"],
        *(_GROUPS["body"] if with_tilt else ()),
        *(_GROUPS["lever_arm"] if with_lever else ()),
    )
