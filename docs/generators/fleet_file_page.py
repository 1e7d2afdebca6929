"""Writes the page of the fleet file from its types: `python docs/generators/fleet_file_page.py`."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Any, Final, get_args

import msgspec
from msgspec import inspect as types

from messages_page import field_table, purpose
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS, OF_STUDIES, Registry
from rcopterx.fleet import schema
from rcopterx.fleet.vehicle_types import TypeFile, TypeTransmitter
from rcopterx.radios.calibration import (
    ArmingChannel,
    Calibration,
    ChannelCalibration,
    SwitchChannel,
    ThrottleCalibration,
)
from rcopterx.radios.limits import (
    ArbiterLimits,
    Fence,
    LandingLimits,
    StandingLimits,
    SurveillanceLimits,
)
from rcopterx.radios.registry import settings_class
from rcopterx.simulator.conditions import Conditions
from rcopterx.vehicles.lift_off import LiftOffLimits
from rcopterx.vehicles.model import Model, Uncertainty
from rcopterx.vehicles.tilt import TiltModel


@dataclass(frozen=True)
class Section:
    """A table of the file: its path and type, a note, and a default for all fields that the type lacks."""

    path: str
    kind: type
    note: str = ""
    own_default: str = ""


VEHICLE: Final = "vehicles.NAME"
CONTROL: Final = f"{VEHICLE}.control"
TRANSMITTER: Final = f"{VEHICLE}.transmitter"
CALIBRATION: Final = f"{TRANSMITTER}.calibration"
MODEL: Final = f"{VEHICLE}.model"
IDENTIFIED: Final = "Written by `rcopterx identify`. The `type`, which is `kind`, gives the other values."


def _parts(registry: Registry[Any], table: str) -> Iterator[Section]:
    """Yield the settings of the built-in controllers or estimators, then of those of rcopterx-studies."""
    added = [name for name in registry.available() if name in OF_STUDIES]
    for name in (*registry.built_in, *added):
        origin = ", of `rcopterx-studies`" if name in added else ""
        note = f'With `{registry.kind} = "{name}"`{origin}.'
        yield Section(f"{CONTROL}.{table}", registry.load(name).Settings, note)


OF_MODEL: Final = (
    "`lower`, `upper` and `floor_m` come from the vehicle's model and from the volume; `standing` is judged."
)
OF_VOLUME: Final = (
    "The fence is the flight volume unless `safety.geofence` is false. Fleets do not trust repeated poses."
)
SECTIONS: Final = (
    Section("", schema.FleetFile),
    Section("volume", schema.VolumeConfig),
    Section("zones.NAME", schema.Zone, "See [safety.md](safety.md#keep-out-zones)."),
    Section("tracker", schema.TrackerConfig, "See [motion_capture.md](motion_capture.md)."),
    Section("simulator", schema.SimulatorConfig),
    Section("simulator.condition_overrides", Conditions, "A default is that of the preset `ideal`."),
    Section("hosts.NAME", schema.HostConfig, "See [multi-host.md](multi-host.md)."),
    Section("bus", schema.BusConfig),
    Section("security", schema.SecurityConfig, "See [security.md](security.md)."),
    Section("gateways.NAME", schema.GatewayConfig),
    Section("subjects.NAME", schema.SubjectConfig, "See [formation.md](formation.md#following-a-wand)."),
    Section("avoidance", schema.AvoidanceConfig, "See [avoidance.md](avoidance.md)."),
    Section("safety", schema.SafetyConfig, "See [safety.md](safety.md)."),
    Section("safety.settings", ArbiterLimits, OF_MODEL),
    Section("safety.settings.surveillance", SurveillanceLimits, OF_VOLUME),
    Section("safety.settings.surveillance.fence", Fence),
    Section(
        "safety.settings.landing", LandingLimits, "Gains come from the vehicle's model unless they are given."
    ),
    Section("safety.settings.standing", StandingLimits, "See [safety.md](safety.md#before-a-take-off)."),
    Section("safety.settings.lift_off", LiftOffLimits, "They come from the vehicle's model."),
    Section("types.NAME", TypeFile, "See [vehicle_types.md](vehicle_types.md)."),
    Section("types.NAME.transmitter", TypeTransmitter),
    Section("types.NAME.battery", schema.VoltageConfig, "See [safety.md](safety.md#voltage-of-the-battery)."),
    Section("log", schema.LogConfig, "See [logs.md](logs.md)."),
    Section("watchdog", schema.WatchdogConfig, "See [safety.md](safety.md#processes-that-hang)."),
    Section(VEHICLE, schema.VehicleConfig),
    Section(f"{VEHICLE}.follow", schema.LeaderConfig, "A list of such tables."),
    Section(f"{VEHICLE}.leader_lost", schema.LeaderLostConfig, "See [formation.md](formation.md)."),
    Section(f"{VEHICLE}.battery", schema.BatteryConfig, "See [safety.md](safety.md)."),
    Section(CONTROL, schema.ControlConfig, "See [control.md](control.md)."),
    *_parts(CONTROLLERS, "settings"),
    *_parts(ESTIMATORS, "estimator_settings"),
    Section(TRANSMITTER, schema.TransmitterConfig, "See [hardware.md](hardware.md)."),
    *(
        Section(f"{TRANSMITTER}.settings", settings_class(name), f'With `protocol = "{name}"`.')
        for name in get_args(schema.ProtocolName)
    ),
    Section(CALIBRATION, Calibration, "Written by `rcopterx calibrate`."),
    Section(f"{CALIBRATION}.pitch", ChannelCalibration, "`roll` and `yaw` have the same keys."),
    Section(f"{CALIBRATION}.throttle", ThrottleCalibration),
    Section(f"{CALIBRATION}.arming", ArmingChannel),
    Section(f"{CALIBRATION}.emergency", SwitchChannel),
    Section(MODEL, Model, IDENTIFIED, own_default="of the type"),
    Section(f"{MODEL}.tilt", TiltModel, own_default="of the type"),
    Section(f"{MODEL}.uncertainty", Uncertainty, own_default="of the type"),
)
"""All tables of the fleet file, in the order of the page."""


def reference() -> str:
    """Return the text of `docs/fleet_file.md`."""
    lines = [Path(__file__).with_name("fleet_file.template").read_text(encoding="utf-8")]
    done: set[str] = set()
    for section in SECTIONS:
        lines += _section(section, first=section.path not in done)
        done.add(section.path)
    return "\n".join(lines).rstrip() + "\n"


def _section(section: Section, first: bool) -> Iterator[str]:
    """Yield heading, purpose, note, and a row for every key."""
    if first:
        yield f"## {f'[{section.path}]' if section.path else 'Top level'}"
        yield ""
    yield " ".join(filter(None, (purpose(section.kind), section.note)))
    yield ""
    rows = field_table(section.kind, lambda _: "table", lambda field: section.own_default or _default(field))
    # TOML has no nil: such a key is left out.
    yield from (row.replace(" or nil", "") for row in rows)
    yield ""


def _default(field: types.Field) -> str:
    if field.required:
        return "**needed**"
    value = field.default_factory() if field.default is msgspec.NODEFAULT else field.default
    if value is None:
        return "none"
    if isinstance(value, msgspec.Struct) or is_dataclass(value) or _holds_tables(value):
        return "see below"
    return f"`{json.dumps(msgspec.to_builtins(value, order='deterministic'))}`"


def _holds_tables(value: Any) -> bool:
    return isinstance(value, dict) and any(isinstance(item, msgspec.Struct) for item in value.values())


if __name__ == "__main__":
    print(reference(), end="")
