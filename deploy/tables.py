"""Dataclasses from tables of the fleet file, with errors that name the field."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import msgspec

from deploy.fleet import FleetError, converted

T = TypeVar("T")


def dataclass_from(kind: type[T], table: Mapping[str, Any], where: str) -> T:
    """Build a dataclass from a table.

    Parameters
    ----------
    kind
        A dataclass type, possibly with dataclass fields.
    table
        Values by field name; tables for dataclass fields.
    where
        Path of the table in the fleet file.

    Returns
    -------
    T
        The object; fields that the table leaves out keep their defaults.

    Raises
    ------
    FleetError
        Unknown field, wrong type, or a value the dataclass refuses.
    """
    _refuse_unknown(kind, table, where)
    return converted(dict(table), kind, where)


def _refuse_unknown(kind: Any, table: Mapping[str, Any], where: str) -> None:
    allowed = {item.name: item.type for item in fields(kind)}
    hints = msgspec.inspect.type_info(kind)
    types = {item.name: item.type for item in getattr(hints, "fields", ())}
    for name, value in table.items():
        if name not in allowed:
            raise FleetError(f"{where}.{name}: unknown field, allowed are {', '.join(allowed)}")
        nested = getattr(types.get(name), "cls", None)
        if isinstance(value, Mapping) and nested is not None and is_dataclass(nested):
            _refuse_unknown(nested, value, f"{where}.{name}")


def replaced(original: T, table: Mapping[str, Any], where: str) -> T:
    """Copy of a dataclass object with some fields changed by a table; errors as in `dataclass_from`."""
    values = {item.name: getattr(original, item.name) for item in fields(original)}  # type: ignore[arg-type]
    _refuse_unknown(type(original), table, where)
    return dataclass_from(type(original), values | dict(table), where)
