"""Reads a fleet file: a TOML document, refused as a whole with the path of the wrong field, or a snapshot."""

import hashlib
import math
import re
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect, structs

from rcopterx import user_text
from rcopterx.bus.message import Four, Name
from rcopterx.bus.messages import Zone
from rcopterx.fleet.consistency import check_consistency
from rcopterx.fleet.schema import (
    FleetError,
    FleetFile,
    GatewayConfig,
    HostConfig,
    Speed,
    SubjectConfig,
    VehicleConfig,
    errors_at,
)
from rcopterx.places import replace_file
from rcopterx.user_text import TextError, similar

SUFFIX = ".json"


def write_snapshot(fleet: FleetFile, path: Path) -> None:
    """Write a fleet file with its defaults, so that later changes of the file have no effect."""
    replace_file(path, msgspec.json.encode(fleet))


def snapshot_of(content: bytes | str) -> FleetFile:
    """Return the fleet of the content of a snapshot, or raise `FleetError`."""
    with errors_at("not a snapshot of a fleet file", msgspec.DecodeError):
        return msgspec.json.decode(content, type=FleetFile)


def digest_of(fleet: FleetFile) -> str:
    """Return a short digest of a fleet without calibrations and models, which may change while it is up."""
    plain = msgspec.to_builtins(fleet)
    for vehicle in plain["vehicles"].values():
        del vehicle["transmitter"]["calibration"]
        del vehicle["model"]
    return hashlib.sha256(msgspec.json.encode(plain, order="deterministic")).hexdigest()[:12]


def at_speed(fleet: FleetFile, speed: float | None, lockstep: bool = False) -> FleetFile:
    """Return a fleet whose time passes at a speed, or in lockstep; None and False mean as in its file.

    Raises `FleetError`: the fleet flies hardware, the speed is out of range, or a part of it cannot wait.
    """
    simulator = fleet.simulator
    if simulator is not None and (lockstep or simulator.lockstep):
        if len(fleet.hosts) > 1 or fleet.tracker.brand != "vicon":
            raise FleetError("lockstep: needs a fleet with one host, and tracker.brand 'vicon'")
        return structs.replace(fleet, simulator=structs.replace(simulator, lockstep=True))
    if lockstep:
        raise FleetError(f"lockstep: {fleet.name} flies hardware, which does not wait; leave it out")
    if speed is None or speed == fleet.clock.speed:
        return fleet
    if fleet.simulator is None:
        raise FleetError(f"speed {speed:g}: {fleet.name} flies hardware, which needs real time; leave it out")
    try:
        msgspec.convert(speed, Speed)
    except msgspec.ValidationError:
        raise FleetError(f"speed {speed:g}: allowed is 0.01 to 10") from None
    return structs.replace(fleet, simulator=structs.replace(fleet.simulator, speed=speed))


T = TypeVar("T")

DEEPEST = 16  # tables and arrays within each other
MAPPINGS: Any = (
    ("vehicles", Name, VehicleConfig),
    ("hosts", Name, HostConfig),
    ("gateways", Name, GatewayConfig),
    ("zones", Name, Zone),
    ("subjects", Name, SubjectConfig),
    ("simulator.start", Name, Four),
    ("tracker.settings", str, str),
    ("types", str, dict[str, Any]),
)
"""Mappings of the fleet file, with the types of their keys and values."""
_LINE = re.compile(r"at line (\d+)")
_QUOTED = re.compile(r"[`'](\w+)[`']")
_COMMA = re.compile(r"=\s*[-+]?\d+,\d")
_STEP = re.compile(r"\.(\w+)|\[")
_type_info = cache(inspect.type_info)


def load_fleet(path: Path) -> FleetFile:
    """Read a fleet file (TOML) or snapshot (JSON); `FleetError` names the file and the wrong field."""
    with errors_at(path):
        if path.is_dir():
            raise FleetError("cannot be read: a directory; name the fleet file in it")
        text = text_of(path)
        return snapshot_of(text) if path.suffix == SUFFIX else parse_fleet(text, path.parent)


def text_of(path: Path) -> str:
    """Return the text of a file; `FleetError` if it cannot be read or is no text."""
    try:
        return user_text.text_of(path)
    except OSError as error:
        raise FleetError(f"cannot be read: {error.strerror}") from None
    except TextError as error:
        raise FleetError(str(error)) from None


def table_of(text: str) -> dict[str, Any]:
    """Return a TOML table, without infinities and deep nesting; else `FleetError`."""
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        number = _LINE.search(str(error))
        line = text.split("\n")[int(number[1]) - 1] if number else ""
        hint = "; numbers have a decimal point" if _COMMA.search(line) else ""
        raise FleetError(f"not TOML: {error}{hint}") from None
    except RecursionError:
        raise FleetError(f"nested more than {DEEPEST} times") from None
    _check_values(raw, "")
    return raw


def parse_fleet(text: str, directory: Path = Path()) -> FleetFile:
    """As `load_fleet`, from text; paths of type files are relative to a directory."""
    raw = table_of(text)
    defaults = raw.pop("defaults", {})
    vehicles = raw.get("vehicles")
    if isinstance(defaults, dict) and isinstance(vehicles, dict):
        raw["vehicles"] = {
            name: merged(defaults, table) if isinstance(table, dict) else table
            for name, table in vehicles.items()
        }
    elif defaults:
        raise FleetError("defaults: must be a table of vehicle fields")
    _check_mappings(raw)
    fleet = converted(raw, FleetFile, "")
    check_consistency(fleet)
    return structs.replace(fleet, types=fleet.types | _type_files(fleet, directory))


def _check_mappings(raw: dict[str, Any]) -> None:
    """Convert the items of mappings one by one: msgspec reports errors in a mapping without their key."""
    for group, key_kind, kind in MAPPINGS:
        table: Any = raw
        for step in group.split("."):
            table = table.get(step) if isinstance(table, dict) else None
        for key, item in table.items() if isinstance(table, dict) else ():
            converted(key, key_kind, f"{group}.{key}")
            converted(item, kind, f"{group}.{key}")


def _type_files(fleet: FleetFile, directory: Path) -> dict[str, dict[str, Any]]:
    """Content of the type files that vehicles name by path: a snapshot works on every host."""
    found = {}
    for vehicle in fleet.vehicles.values():
        if vehicle.type.endswith(".toml"):
            with errors_at(vehicle.type):
                found[vehicle.type] = table_of(text_of(directory / Path(vehicle.type).expanduser()))
    return found


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Merge two tables recursively; values of `over` win."""
    result = dict(base)
    for key, value in over.items():
        present = result.get(key)
        if isinstance(present, Mapping) and isinstance(value, Mapping):
            value = merged(present, value)
        result[key] = value
    return result


def converted(raw: object, kind: type[T], where: str, *, strict: bool = True) -> T:
    """Convert a table at the path `where` of the file to a type; unless `strict`, texts become numbers.

    Raises `FleetError`: names the path of a wrong type, a missing or unknown field, or a refused value.
    """
    try:
        return msgspec.convert(raw, kind, strict=strict)
    except msgspec.ValidationError as error:
        what, _, place = str(error).partition(" - at `")
        below = place.rstrip("`").removeprefix("key` in `").removeprefix("$")
        path = f"{where}{below}".removeprefix(".")
        if "unknown field" in what or "enum value" in what:
            allowed, wrong = _allowed_at(kind, below), _QUOTED.search(what)
            hint = similar(wrong[1], allowed) if wrong else ""
            what = f"{what}, allowed are {', '.join(allowed) or 'none'}{hint}"
        raise FleetError(f"{path or 'top level'}: {what[0].lower()}{what[1:]}") from None


def _check_values(value: object, where: str, depth: int = 0) -> None:
    """Refuse nan, inf and NUL, which TOML permits, and deeply nested tables and arrays."""
    if isinstance(value, float) and not math.isfinite(value):
        raise FleetError(f"{where}: {value} is not a finite number")
    if isinstance(value, str) and "\0" in value:
        raise FleetError(f"{where}: contains the character NUL")
    if depth > DEEPEST:
        raise FleetError(f"{where}: nested more than {DEEPEST} times")
    if isinstance(value, dict):
        for key, item in value.items():
            _check_values(item, f"{where}.{key}" if where else str(key), depth + 1)
    elif isinstance(value, list):
        for number, item in enumerate(value):
            _check_values(item, f"{where}[{number}]", depth + 1)


def dataclass_from(kind: type[T], table: Mapping[str, Any], where: str) -> T:
    """Build a dataclass from a table at the path `where` of the file; `FleetError` for a wrong field."""
    _refuse_unknown(kind, table, where)
    return converted(dict(table), kind, where)


def _refuse_unknown(kind: Any, table: Mapping[str, Any], where: str) -> None:
    info: Any = _type_info(kind)
    types = {field.name: _without_none(field.type) for field in info.fields}
    for name, value in table.items():
        if name not in types:
            hint = similar(name, types)
            raise FleetError(f"{where}.{name}: unknown field, allowed are {', '.join(types)}{hint}")
        if isinstance(value, Mapping) and isinstance(types[name], inspect.DataclassType):
            _refuse_unknown(types[name].cls, value, f"{where}.{name}")


def replaced(original: T, table: Mapping[str, Any], where: str) -> T:
    """Return a dataclass object with fields changed by a table; errors as in `dataclass_from`."""
    if not table:
        return original
    return dataclass_from(type(original), merged(msgspec.to_builtins(original), table), where)


def _allowed_at(kind: Any, below: str) -> tuple[str, ...]:
    """Return the fields or words allowed at a place below a type, such as `.follow[0].frame`."""
    node: Any = _type_info(kind)
    for step in _STEP.finditer(below):
        node = _inside(_without_none(node), step[1])
    node = _without_none(node)
    if isinstance(node, inspect.StructType):
        return tuple(field.encode_name for field in node.fields)
    return tuple(map(str, node.values)) if isinstance(node, inspect.LiteralType) else ()


def _inside(node: Any, name: str | None) -> Any:
    """Return the type of a field of a table, or of the items of a mapping or an array."""
    match node:
        case inspect.StructType():
            return next(field.type for field in node.fields if field.encode_name == name)
        case inspect.DictType():
            return node.value_type
        case inspect.VarTupleType() | inspect.ListType():
            return node.item_type
        case _:
            return inspect.AnyType()


def _without_none(node: Any) -> Any:
    if not isinstance(node, inspect.UnionType):
        return node
    return next(member for member in node.types if not isinstance(member, inspect.NoneType))


def shipped_fleets() -> dict[str, Path]:
    """Return the fleet files that come with the package, by name."""
    with as_file(files("rcopterx.fleet") / "fleets") as directory:
        return {path.stem: path for path in sorted(directory.glob("*.toml"))}


def fleet_path(name: str) -> Path:
    """Return the path of a fleet file or shipped fleet; `FleetError` if there is neither."""
    path = Path(name)
    if path.exists():
        return path
    shipped = shipped_fleets()
    # Paths of the source tree also name shipped files, so that examples in the documentation work anywhere.
    if name in shipped or (path.suffix == ".toml" and path.parent.name == "fleets" and path.stem in shipped):
        return shipped[path.stem]
    raise FleetError(f"{name}: no such file; shipped fleets are {', '.join(shipped)}{similar(name, shipped)}")
