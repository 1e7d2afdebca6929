"""Settings every estimator shares, and how they are read from plain data."""

import math
from collections.abc import Mapping
from typing import Annotated, TypeVar

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0)]
FourPositive = tuple[Positive, Positive, Positive, Positive]


class EstimatorSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Settings of the innovation gate, common to all estimators that come with the package."""

    position_gate_m: Positive = 0.06
    """A pose is refused when it departs from the prediction by more than this plus five deviations."""
    yaw_gate_rad: Positive = 0.35
    """The same for the heading."""
    gate_limit_s: Positive = 0.25
    """Poses that agree with each other for so long while the gate refuses them are believed after all."""


Settings = TypeVar("Settings", bound=msgspec.Struct)


def parse_settings(kind: type[Settings], values: Mapping[str, object]) -> Settings:
    """Read settings from plain data, as a fleet file or a request gives them.

    Parameters
    ----------
    kind
        The estimator's settings type.
    values
        Names and values; what is left out keeps its default.

    Returns
    -------
    msgspec.Struct
        Settings of that type.

    Raises
    ------
    ValueError
        Unknown name (the message lists what is allowed), wrong type, value out of its range or not finite.
    """
    allowed = kind.__struct_fields__
    for name, value in values.items():
        if name not in allowed:
            raise ValueError(f"unknown setting {name!r}; allowed are {', '.join(allowed)}")
        if not _all_finite(value):
            raise ValueError(f"{name}: every number must be finite, got {value}")
    try:
        return msgspec.convert(dict(values), kind)
    except msgspec.ValidationError as error:
        raise ValueError(str(error)) from error


def _all_finite(value: object) -> bool:
    if isinstance(value, list | tuple):
        return all(map(_all_finite, value))
    return not isinstance(value, float) or math.isfinite(value)
