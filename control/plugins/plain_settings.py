"""Settings of controllers and estimators from plain data: a fleet file's table, a request's body."""

import math
from collections.abc import Mapping
from typing import TypeVar

import msgspec


class SettingsError(ValueError):
    """A setting is missing, of the wrong type, or outside what is allowed."""


Settings = TypeVar("Settings", bound=msgspec.Struct)


def parse_settings(kind: type[Settings], values: Mapping[str, object]) -> Settings:
    """Convert names and values into settings of a type; missing ones keep their defaults.

    Raises `SettingsError` for unknown names (the message lists what is allowed), and for values of a wrong
    type, not finite or outside their range.
    """
    unknown = sorted(set(values) - set(kind.__struct_fields__))
    if unknown:
        raise SettingsError(
            f"unknown setting {unknown[0]!r}; allowed are {', '.join(kind.__struct_fields__)}"
        )
    for name, value in values.items():
        if not _all_finite(value):
            raise SettingsError(f"{name}: every number must be finite, got {value}")
    try:
        return msgspec.convert(dict(values), kind)
    except msgspec.ValidationError as error:
        raise SettingsError(str(error)) from error


def _all_finite(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, list | tuple):
        return all(_all_finite(item) for item in value)
    return True
