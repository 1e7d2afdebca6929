"""Vehicle types: one TOML file each, in this package, in an installed one, or beside a fleet file.

A package adds a type through the entry-point group `rcopterx.vehicle_types`: the entry point `NAME` names a
package that contains `NAME.toml`.
"""

from functools import cache
from importlib.metadata import entry_points
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct, field

from rcopterx.bus.message import Name
from rcopterx.fleet.reading import converted, dataclass_from, merged, replaced, table_of
from rcopterx.fleet.schema import FleetError, FleetFile, ProtocolName, Table, Text, VoltageConfig, errors_at
from rcopterx.radios.battery import BatteryLimits, BatteryLimitsError
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.user_text import decoded, similar
from rcopterx.vehicles.model import Model

GROUP = "rcopterx.vehicle_types"
SUFFIX = ".toml"
_OWN = files("rcopterx.vehicles") / "types"


class TypeTransmitter(Table, frozen=True, kw_only=True):
    """What a type requires of its radio; a vehicle's `transmitter` table overrides it."""

    protocol: ProtocolName = "multi"
    """Protocol of the radio module."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the protocol."""
    calibration: dict[str, Any] = field(default_factory=dict)
    """Map from normalised inputs to pulse widths, by channel."""


class TypeFile(Table, frozen=True, kw_only=True):
    """A type of vehicle."""

    text: Text
    """What it is, for people."""
    base: Name | None = None
    """Type that gives all that this one leaves out."""
    model: dict[str, Any]
    """All parameters of the model that have no default."""
    transmitter: TypeTransmitter = field(default_factory=TypeTransmitter)
    """Radio and calibration."""
    battery: VoltageConfig = field(default_factory=VoltageConfig)
    """What the voltage of its battery permits."""
    safety: dict[str, Any] = field(default_factory=dict)
    """Limits of the arbiter that differ from the defaults, as in `safety.settings` of a fleet file."""
    lowest_ceiling_m: Annotated[float, Meta(ge=0, le=20)] = 0.0
    """Lowest upper end of the flight volume in which it can take off."""


class VehicleType(Struct, frozen=True):
    """A type of vehicle; `fleet.radios` checks what it requires of its radio, the rest was checked."""

    name: str
    file: TypeFile
    model: Model
    source: str  # its file or table, for errors


def type_names() -> list[str]:
    """Return the names of all types that `vehicle_type` accepts."""
    own = (file.name for file in _OWN.iterdir())
    shipped = {name.removesuffix(SUFFIX) for name in own if name.endswith(SUFFIX)}
    return sorted(shipped | {point.name for point in entry_points(group=GROUP)})


@cache
def vehicle_type(name: str) -> VehicleType:
    """Return a type of this package, or else of an installed one; `FleetError` names a wrong file and key."""
    if name not in type_names():
        allowed, hint = ", ".join(type_names()), similar(name, type_names())
        raise FleetError(f"unknown type {name!r}, allowed are {allowed}, or a path of a file *{SUFFIX}{hint}")
    file, place = f"{name}{SUFFIX}", "rcopterx"
    source = _OWN / file
    if not source.is_file():
        place = next(point.value for point in entry_points(group=GROUP) if point.name == name)
    with errors_at(f"type {name!r} of {place}: cannot be read", OSError, ImportError, ValueError):
        source = source if source.is_file() else files(place) / file
        table = table_of(decoded(source.read_bytes()))
    return _checked(name, table, str(source))


def type_of(fleet: FleetFile, name: str) -> VehicleType:
    """Return the type of a vehicle; raises `FleetError` as `vehicle_type`."""
    wanted = fleet.vehicles[name].type
    if wanted in fleet.types:
        source = wanted if wanted.endswith(SUFFIX) else f"types.{wanted}"
        return _checked(Path(wanted).name.removesuffix(SUFFIX), fleet.types[wanted], source)
    with errors_at(f"vehicles.{name}.type"):
        return vehicle_type(wanted)


def _checked(name: str, table: dict[str, Any], source: str) -> VehicleType:
    """Check the tables of a type, except its radio's; `FleetError` names the source and the key."""
    with errors_at(source):
        converted({"model": {}} | table, TypeFile, "")
        if (base := table.get("base")) is not None:
            plain = msgspec.to_builtins(vehicle_type(base).file)
            table = merged(plain, table) | {"base": plain["base"]}
        file = converted(table, TypeFile, "")
        if "kind" in file.model:
            raise FleetError("model.kind: it is the name of the type, leave it out")
        model = dataclass_from(Model, {"kind": name, **file.model}, "model")
        replaced(ArbiterLimits(), file.safety, "safety")
        battery_limits(file.battery, "battery")
        return VehicleType(name, file, model, source)


def battery_limits(config: VoltageConfig, where: str, default: VoltageConfig | None = None) -> BatteryLimits:
    """Return voltages of a table, and of `default` where it has none; `FleetError` if they contradict."""
    others = default or config
    warn_v = others.warn_v if config.warn_v is None else config.warn_v
    land_v = others.land_v if config.land_v is None else config.land_v
    full_v = config.full_v
    if full_v is None and (others.full_v or 0.0) > max(warn_v or 0.0, land_v or 0.0):
        full_v = others.full_v  # not of a battery with more cells than that of the type
    hover_s = others.hover_s if config.hover_s is None else config.hover_s
    try:
        return BatteryLimits(warn_v, land_v, full_v, hover_s)
    except BatteryLimitsError as error:
        raise FleetError(f"{where}.{error}") from None
