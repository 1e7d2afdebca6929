"""Writes the page of the fleet file: `python -m rcopterx.fleet.reference > docs/fleet_file.md`.

Keys, types, defaults, limits and meanings come from the types in `schema`.
"""

import ast
import inspect
import json
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from typing import Any, Final

import msgspec
from msgspec import inspect as types

from rcopterx.bus.reference import bounds, documented, one_line
from rcopterx.control.controllers.registry import CONTROLLERS
from rcopterx.control.estimators.registry import ESTIMATORS
from rcopterx.fleet import schema
from rcopterx.simulator.conditions import Conditions
from rcopterx.transmitter_gateway.calibration import Calibration, ChannelCalibration, ThrottleCalibration
from rcopterx.transmitter_gateway.limits import ArbiterLimits, Fence, LandingLimits, SurveillanceLimits
from rcopterx.transmitter_gateway.protocols.dsm2_serial import Dsm2Settings
from rcopterx.transmitter_gateway.protocols.dsmp import DsmpSettings
from rcopterx.transmitter_gateway.protocols.multi import MultiSettings
from rcopterx.transmitter_gateway.protocols.ppm import PpmSettings
from rcopterx.vehicles.model import Model, Uncertainty
from rcopterx.vehicles.tilt import TiltModel

HEAD: Final = """\
# The fleet file

Generated from the types that read the file by `python -m rcopterx.fleet.reference`.

A fleet is one TOML file. Only `name` and one vehicle with `subject` and `transmitter.port` are needed;
everything else has a default. A file with a wrong or unknown key is refused as a whole, with the path of the
key and what is allowed, and nothing is started. A complete file:

```toml
{example}```

- SI units; the end of a key is its unit. Angles in the file are radians, on the command line degrees.
- A *name* is `[a-z][a-z0-9_]{0,30}`. Every number is finite.
- A table `[defaults]` holds keys that all vehicles share; those of a vehicle win, key by key.
- Positions are in the inertial frame of the motion capture, z up.
"""


EXAMPLE: Final = """\
name = "lab"

[tracker]
address = "192.168.0.5:801"

[vehicles.h1]
subject = "heli1"
transmitter = { port = "/dev/ttyUSB0", model_match = 1 }

[vehicles.h2]
subject = "heli2"
transmitter = { port = "/dev/ttyUSB1", model_match = 2 }
follow = [{ leader = "h1", offset_m = [-0.4, 0.5, 0.0] }]
"""
UNITS: Final = {
    "_m_s2": "m/s²",
    "_rad_s": "rad/s",
    "_m_s": "m/s",
    "_per_s": "1/s",
    "_us": "µs",
    "_gb": "GB",
    "_mb": "MB",
    "_hz": "Hz",
    "_rad": "rad",
    "_m": "m",
    "_s": "s",
}
"""Units by the end of a key; the first match counts."""


@dataclass(frozen=True)
class Section:
    """A table of the file: its path and type, a note, and a default for all fields that the type lacks."""

    path: str
    kind: type
    note: str = ""
    own_default: str = ""


def sections() -> list[Section]:
    """Return all tables of the fleet file, in the order of the page."""
    vehicle = "vehicles.NAME"
    control, transmitter = f"{vehicle}.control", f"{vehicle}.transmitter"
    calibration, model = f"{transmitter}.calibration", f"{vehicle}.model"
    return [
        Section("", schema.FleetFile),
        Section("volume", schema.VolumeConfig),
        Section("tracker", schema.TrackerConfig, "See [motion_capture.md](motion_capture.md)."),
        Section("simulator", schema.SimulatorConfig),
        Section("simulator.condition_overrides", Conditions, "A default is that of the preset `ideal`."),
        Section("hosts.NAME", schema.HostConfig, "See [multi-host.md](multi-host.md)."),
        Section("bus", schema.BusConfig),
        Section("security", schema.SecurityConfig, "See [security.md](security.md)."),
        Section("gateways.NAME", schema.GatewayConfig),
        Section("avoidance", schema.AvoidanceConfig, "See [avoidance.md](avoidance.md)."),
        Section("safety", schema.SafetyConfig, "See [safety.md](safety.md)."),
        Section(
            "safety.settings",
            ArbiterLimits,
            "`lower`, `upper` and `floor_m` come from the vehicle's model and from the volume.",
        ),
        Section(
            "safety.settings.surveillance",
            SurveillanceLimits,
            "The fence is the flight volume unless `safety.geofence` is false.",
        ),
        Section("safety.settings.surveillance.fence", Fence),
        Section(
            "safety.settings.landing",
            LandingLimits,
            "Gains come from the vehicle's model unless they are given.",
        ),
        Section("log", schema.LogConfig, "See [logs.md](logs.md)."),
        Section("watchdog", schema.WatchdogConfig, "See [safety.md](safety.md#processes-that-hang)."),
        Section(vehicle, schema.VehicleConfig),
        Section(f"{vehicle}.follow", schema.LeaderConfig, "A list of such tables."),
        Section(f"{vehicle}.leader_lost", schema.LeaderLostConfig, "See [formation.md](formation.md)."),
        Section(f"{vehicle}.battery", schema.BatteryConfig, "See [safety.md](safety.md)."),
        Section(control, schema.ControlConfig, "See [control.md](control.md)."),
        *(
            Section(f"{control}.settings", CONTROLLERS.load(name).Settings, f'With `controller = "{name}"`.')
            for name in CONTROLLERS.built_in
        ),
        *(
            Section(
                f"{control}.estimator_settings",
                ESTIMATORS.load(name).Settings,
                f'With `estimator = "{name}"`.',
            )
            for name in ESTIMATORS.built_in
        ),
        Section(transmitter, schema.TransmitterConfig, "See [hardware.md](hardware.md)."),
        *(
            Section(f"{transmitter}.settings", kind, f'With `protocol = "{protocol}"`.')
            for protocol, kind in PROTOCOLS.items()
        ),
        Section(calibration, Calibration, "Written by `rcopterx calibrate`."),
        Section(f"{calibration}.pitch", ChannelCalibration, "`roll` and `yaw` have the same keys."),
        Section(f"{calibration}.throttle", ThrottleCalibration),
        Section(
            model,
            Model,
            "Written by `rcopterx identify`. The `type` gives the other values.",
            own_default="of the type",
        ),
        Section(f"{model}.tilt", TiltModel, own_default="of the type"),
        Section(f"{model}.uncertainty", Uncertainty, own_default="of the type"),
    ]


PROTOCOLS: Final[dict[str, type]] = {
    "multi": MultiSettings,
    "dsm2_serial": Dsm2Settings,
    "dsmp": DsmpSettings,
    "ppm": PpmSettings,
}


def reference() -> str:
    """Return the text of `docs/fleet_file.md`."""
    lines = [HEAD.replace("{example}", EXAMPLE)]
    done: set[str] = set()
    for section in sections():
        lines += _section(section, first=section.path not in done)
        done.add(section.path)
    return "\n".join(lines).rstrip() + "\n"


def _section(section: Section, first: bool) -> Iterator[str]:
    """Yield heading, purpose, note, and a row for every key."""
    if first:
        yield f"## {f'[{section.path}]' if section.path else 'Top level'}"
        yield ""
    yield " ".join(filter(None, (_purpose(section.kind), section.note)))
    yield ""
    yield "| key | type | unit | default | meaning |"
    yield "| --- | --- | --- | --- | --- |"
    meanings = meanings_of(section.kind)
    info = types.type_info(section.kind)
    for field in getattr(info, "fields", ()):
        default = section.own_default or _default(field)
        unit = next((unit for end, unit in UNITS.items() if field.name.endswith(end)), "")
        meaning = meanings.get(field.name, "")
        yield f"| `{field.name}` | {_type(field.type)} | {unit} | {default} | {meaning} |"
    yield ""


def _purpose(kind: type) -> str:
    return one_line((kind.__doc__ or "").split("\n\n")[0])


def meanings_of(kind: type) -> dict[str, str]:
    """Return the documentation of the fields of a type: strings below them, or its parameter section."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__[:-1]):
        if base.__module__.partition(".")[0] == "msgspec":
            continue
        node = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        found |= dict(_parameters(inspect.cleandoc(base.__doc__ or "")))
        found |= dict(documented(node))
    return found


_PARAMETER: Final = re.compile(r"^(\w+(?:, \w+)*)(?: : [^\n]*)?\n((?: {4}[^\n]*\n?)+)", re.MULTILINE)


def _parameters(text: str) -> Iterator[tuple[str, str]]:
    """Yield the entries of the section Parameters or Attributes of a docstring."""
    _, _, entries = text.partition("----\n")
    for names, meaning in _PARAMETER.findall(entries.partition("\n\n")[0] + "\n"):
        for name in names.split(", "):
            yield name, one_line(meaning)


def _default(field: types.Field) -> str:
    if field.required:
        return "**needed**"
    value = field.default_factory() if field.default is msgspec.NODEFAULT else field.default
    if value is None:
        return "none"
    if isinstance(value, msgspec.Struct) or is_dataclass(value) or _holds_tables(value):
        return "see below"
    return f"`{json.dumps(_sorted(value))}`"


def _sorted(value: Any) -> Any:
    return sorted(value) if isinstance(value, frozenset) else msgspec.to_builtins(value)


def _holds_tables(value: Any) -> bool:
    return isinstance(value, dict) and any(isinstance(item, msgspec.Struct) for item in value.values())


def _type(kind: Any) -> str:
    """Return the type of a key as text."""
    match kind:
        case types.BoolType():
            return "boolean"
        case types.IntType() | types.FloatType():
            return ("integer" if isinstance(kind, types.IntType) else "number") + bounds(kind)
        case types.StrType():
            return "name" if kind.pattern is not None else "text"
        case types.LiteralType():
            return " or ".join(f"`{word}`" for word in kind.values)
        case types.AnyType():
            return "anything"
        case types.UnionType():
            return " or ".join(
                _type(member) for member in kind.types if not isinstance(member, types.NoneType)
            )
        case types.TupleType():
            return f"list of {len(kind.item_types)}: {_type(kind.item_types[0])}"
        case types.VarTupleType() | types.ListType() | types.FrozenSetType():
            return f"list of {_type(kind.item_type)}"
        case types.DictType():
            inner = _type(kind.value_type)
            return {"anything": "table", "table": "tables by name"}.get(inner, f"table of {inner}")
        case types.StructType() | types.DataclassType():
            return "table"
    raise TypeError(f"no text for {kind}")


if __name__ == "__main__":
    print(reference(), end="")
