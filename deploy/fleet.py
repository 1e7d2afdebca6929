"""The fleet file: one TOML document that describes everything, refused as a whole if any field is wrong.

A file without a `[simulator]` table flies hardware: that table, the Tracker's address and the serial ports
are the only difference.
"""

import math
import os.path
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import msgspec
from msgspec import Meta, field

from bus import channels
from deploy.field_help import allowed_at
from deploy.laboratory_tables import (
    DEFAULT_HOST,
    Four,
    Name,
    Positive,
    Simulator,
    Table,
    Text,
    Three,
    Tracker,
    Volume,
)

T = TypeVar("T")

RESERVED_UNITS = (channels.TRACKER_UNIT, channels.SIMULATOR_UNIT, channels.FLEET_UNIT)
"""Units of the bus that are no vehicles."""
RESERVED_PROCESSES = ("router", "simulator", "tracker", "spare")
"""Names of processes that are no transmitter gateways."""


class FleetError(ValueError):
    """The fleet file cannot be used; names the file, the field and what is allowed."""


class Host(Table, frozen=True, kw_only=True):
    """A computer that runs part of the fleet."""

    address: str = "127.0.0.1"
    """Where other hosts reach it."""
    router_port: Annotated[int, Meta(ge=1, le=65535)] = 7447


class Bus(Table, frozen=True, kw_only=True):
    """How processes talk and how they are scheduled."""

    namespace: Name | None = None
    """Keeps fleets of tests apart; leave it out in a laboratory."""
    realtime_priority: Annotated[int, Meta(ge=0, le=90)] = 20
    """SCHED_FIFO priority where the operating system permits it; 0 for none."""


class Gateway(Table, frozen=True, kw_only=True):
    """A transmitter gateway process."""

    host: Name = DEFAULT_HOST


class Transmitter(Table, frozen=True, kw_only=True):
    """A vehicle's transmitter."""

    port: Text
    """Serial device; with a `[simulator]` a relative path is created in the fleet's run directory."""
    gateway: Name = "transmitters"
    protocol: Literal["multi", "dsm2_serial", "dsmp", "ppm"] = "multi"
    model_match: Annotated[int, Meta(ge=0, le=63)] = 0
    low_power: bool = False
    """Ask the radio for low power."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the protocol."""
    calibration: dict[str, Any] = field(default_factory=dict)
    """From normalised input to pulse width, by channel."""


class Control(Table, frozen=True, kw_only=True):
    """Controller and estimator of a vehicle."""

    controller: str = "cascade"
    estimator: str = "extended_kalman"
    horizon: Annotated[int, Meta(ge=2, le=200)] = 50
    period_s: Annotated[float, Meta(gt=0, le=0.2)] = 0.02
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the controller: weights, constraints, options."""
    estimator_settings: dict[str, Any] = field(default_factory=dict)
    leader_wait_s: Annotated[float, Meta(ge=0, le=0.015)] = 0.002
    """How long after its own pose a follower waits for the leader's plan of the same frame."""


class Leader(Table, frozen=True, kw_only=True):
    """Whom a vehicle follows from the start."""

    leader: Name
    offset_m: Three
    yaw_offset_rad: float = 0.0
    frame: Literal["inertial", "heading"] = "inertial"
    weight: Positive = 1.0


class LeaderLost(Table, frozen=True, kw_only=True):
    """What a follower does when its leaders are lost, after it has ridden out their last plans."""

    then: Literal["hold", "promote", "land"] = "hold"
    """Keep the place; follow a successor or become it; or land."""
    after_s: Annotated[float, Meta(ge=0.5, le=60)] = 2.0
    """How long leaders are waited for; until then the place is kept."""


class Vehicle(Table, frozen=True, kw_only=True):
    """One vehicle."""

    transmitter: Transmitter
    type: str = "coaxial"
    host: Name = DEFAULT_HOST
    subject: Text
    """Name of the vehicle's subject in the Tracker."""
    control: Control = field(default_factory=Control)
    follow: list[Leader] = field(default_factory=list)
    leader_lost: LeaderLost = field(default_factory=LeaderLost)
    successors: list[Name] = field(default_factory=list)
    """Who leads the followers of this vehicle when it is lost, the first one first; then the others that may,
    in the order of the file."""
    model: dict[str, Any] = field(default_factory=dict)
    """Parameters that differ from those of the type."""


class Avoidance(Table, frozen=True, kw_only=True):
    """Vehicles keep clear of each other's plans."""

    enabled: bool = True
    horizontal_m: Annotated[float, Meta(gt=0, le=5)] = 0.35
    """Half axes of the ellipsoid around a vehicle that no other one enters; rotor wash makes it tall."""
    vertical_m: Annotated[float, Meta(gt=0, le=5)] = 0.6


class Safety(Table, frozen=True, kw_only=True):
    """Limits the transmitter gateway enforces by itself."""

    geofence: bool = True
    settings: dict[str, Any] = field(default_factory=dict)


class Fleet(Table, frozen=True, kw_only=True):
    """The whole fleet."""

    name: Name
    hosts: dict[Name, Host] = field(default_factory=lambda: {DEFAULT_HOST: Host()})
    bus: Bus = field(default_factory=Bus)
    volume: Volume = field(default_factory=Volume)
    tracker: Tracker = field(default_factory=Tracker)
    simulator: Simulator | None = None
    gateways: dict[Name, Gateway] = field(default_factory=lambda: {"transmitters": Gateway()})
    avoidance: Avoidance = field(default_factory=Avoidance)
    safety: Safety = field(default_factory=Safety)
    vehicles: dict[Name, Vehicle]

    def endpoint(self, host: str) -> str:
        """Zenoh endpoint at which other hosts reach the router of a host."""
        return f"tcp/{self.hosts[host].address}:{self.hosts[host].router_port}"


def load_fleet(path: Path) -> Fleet:
    """Read and validate a fleet file.

    Parameters
    ----------
    path
        A TOML file.

    Returns
    -------
    Fleet
        Consistent in itself: names, hosts, leaders and devices refer to each other correctly.

    Raises
    ------
    FleetError
        Names the file, the path of the bad field, and what is allowed.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise FleetError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise FleetError(f"{path}: not UTF-8 text: {error.reason} at byte {error.start}") from None
    try:
        return parse_fleet(text)
    except FleetError as error:
        raise FleetError(f"{path}: {error}") from None


def parse_fleet(text: str) -> Fleet:
    """As `load_fleet`, from text."""
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FleetError(f"not TOML: {error}") from None
    _check_finite(raw, "")
    defaults = raw.pop("defaults", {})
    vehicles = raw.get("vehicles")
    if isinstance(defaults, dict) and isinstance(vehicles, dict):
        raw["vehicles"] = {
            name: merged(defaults, table) if isinstance(table, dict) else table
            for name, table in vehicles.items()
        }
    elif defaults:
        raise FleetError("defaults: must be a table of vehicle fields")
    # One by one first, because a fault anywhere in a mapping is reported without its key.
    for group, kind in (("vehicles", Vehicle), ("hosts", Host), ("gateways", Gateway)):
        tables = raw.get(group)
        for name, table in tables.items() if isinstance(tables, dict) else ():
            converted(name, Name, f"{group}.{name}")
            converted(table, kind, f"{group}.{name}")
    fleet = converted(raw, Fleet, "")
    _check_vehicles(fleet)
    _check_hosts(fleet)
    _check_leaders(fleet)
    return fleet


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Tables laid over each other, deeply; values of `over` win."""
    result = dict(base)
    for key, value in over.items():
        present = result.get(key)
        both = isinstance(present, dict) and isinstance(value, dict)
        result[key] = merged(present, value) if both and isinstance(present, dict) else value
    return result


def converted(raw: object, kind: type[T], where: str) -> T:
    """Typed object from a table of the file.

    Parameters
    ----------
    raw
        The table.
    kind
        Type wanted.
    where
        Path of the table in the file, empty for the whole file.

    Returns
    -------
    T
        The object.

    Raises
    ------
    FleetError
        Wrong type, missing or unknown field, or a value the type refuses; names the path of the field.
    """
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        what, _, place = str(error).partition(" - at `")
        below = place.rstrip("`").removeprefix("key` in `").removeprefix("$")
        path = f"{where}{below}".removeprefix(".")
        if "unknown field" in what or "enum value" in what:
            what = f"{what}, allowed are {', '.join(allowed_at(kind, below))}"
        raise FleetError(f"{path or 'top level'}: {what[0].lower()}{what[1:]}") from None


def _check_finite(value: object, where: str) -> None:
    """TOML knows nan and inf; nothing in a fleet is either."""
    if isinstance(value, float) and not math.isfinite(value):
        raise FleetError(f"{where}: {value} is not a finite number")
    if isinstance(value, dict):
        for key, item in value.items():
            _check_finite(item, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list):
        for number, item in enumerate(value):
            _check_finite(item, f"{where}[{number}]")


def _check_vehicles(fleet: Fleet) -> None:
    if not fleet.vehicles:
        raise FleetError("vehicles: at least one vehicle is needed")
    for group, names, reserved in (
        ("vehicles", fleet.vehicles, RESERVED_UNITS),
        ("gateways", fleet.gateways, RESERVED_PROCESSES),
    ):
        for name in names:
            if name in reserved:
                raise FleetError(f"{group}.{name}: the name is reserved, as are {', '.join(reserved)}")
    _check_unique("subject", {name: vehicle.subject for name, vehicle in fleet.vehicles.items()})
    _check_unique(
        "transmitter.port",
        {name: os.path.normpath(vehicle.transmitter.port) for name, vehicle in fleet.vehicles.items()},
    )
    low, high = fleet.volume.min_m, fleet.volume.max_m
    for axis, (a, b) in enumerate(zip(low, high, strict=True)):
        if not a < b:
            raise FleetError(f"volume.max_m[{axis}]: {b} must be greater than min_m[{axis}] = {a}")


def _check_unique(field_name: str, values: Mapping[str, str]) -> None:
    seen: dict[str, str] = {}
    for name, value in values.items():
        if value in seen:
            raise FleetError(
                f"vehicles.{name}.{field_name}: {value!r} is already that of vehicles.{seen[value]}"
            )
        seen[value] = name


def _check_hosts(fleet: Fleet) -> None:
    addresses: dict[str, str] = {}
    for name, host in fleet.hosts.items():
        address = f"{host.address}:{host.router_port}"
        other = addresses.setdefault(address, name)
        if other != name:
            raise FleetError(f"hosts.{name}.router_port: {address} is already that of hosts.{other}")
        if fleet.simulator is not None and address == fleet.tracker.address:
            raise FleetError(f"tracker.address: {address} is already that of the router of hosts.{name}")
    uses = {"tracker.host": fleet.tracker.host}
    if fleet.simulator is not None:
        uses["simulator.host"] = fleet.simulator.host
    uses |= {f"gateways.{name}.host": gateway.host for name, gateway in fleet.gateways.items()}
    uses |= {f"vehicles.{name}.host": vehicle.host for name, vehicle in fleet.vehicles.items()}
    for where, used in uses.items():
        if used not in fleet.hosts:
            raise FleetError(f"{where}: unknown host {used!r}, known are {', '.join(fleet.hosts)}")
    for name, vehicle in fleet.vehicles.items():
        gateway = vehicle.transmitter.gateway
        if gateway not in fleet.gateways:
            known = ", ".join(fleet.gateways)
            raise FleetError(
                f"vehicles.{name}.transmitter.gateway: unknown gateway {gateway!r}, known are {known}"
            )
        if fleet.simulator is not None and fleet.gateways[gateway].host != fleet.simulator.host:
            raise FleetError(
                f"gateways.{gateway}.host: simulated radios are on the simulator's host "
                f"{fleet.simulator.host!r}, not on {fleet.gateways[gateway].host!r}"
            )
    for name in () if fleet.simulator is None else fleet.simulator.start:
        if name not in fleet.vehicles:
            known = ", ".join(fleet.vehicles)
            raise FleetError(f"simulator.start.{name}: unknown vehicle, known are {known}")


def _check_leaders(fleet: Fleet) -> None:
    for name, vehicle in fleet.vehicles.items():
        leaders = [link.leader for link in vehicle.follow]
        for number, link in enumerate(vehicle.follow):
            where = f"vehicles.{name}.follow[{number}].leader"
            if link.leader not in fleet.vehicles:
                raise FleetError(
                    f"{where}: unknown vehicle {link.leader!r}, known are {', '.join(fleet.vehicles)}"
                )
            if link.leader == name:
                raise FleetError(f"{where}: {name} cannot follow itself, that is a cycle")
            if link.leader in leaders[:number]:
                raise FleetError(f"{where}: {link.leader!r} is named twice")
        for number, successor in enumerate(vehicle.successors):
            where = f"vehicles.{name}.successors[{number}]"
            if successor not in fleet.vehicles or successor == name:
                others = ", ".join(other for other in fleet.vehicles if other != name)
                raise FleetError(f"{where}: {successor!r} cannot succeed {name}, allowed are {others}")
            if successor in vehicle.successors[:number]:
                raise FleetError(f"{where}: {successor!r} is named twice")
            if fleet.vehicles[successor].leader_lost.then != "promote":
                raise FleetError(
                    f'{where}: {successor} does not want to lead; give it leader_lost.then = "promote"'
                )
    for name in fleet.vehicles:
        cycle = _cycle_from(fleet, name)
        if cycle:
            raise FleetError(f"vehicles.{name}.follow: a cycle of leaders: {' -> '.join(cycle)}")


def _cycle_from(fleet: Fleet, start: str) -> list[str]:
    stack = [[start]]
    while stack:
        path = stack.pop()
        for link in fleet.vehicles[path[-1]].follow:
            if link.leader == start:
                return [*path, start]
            if link.leader not in path:
                stack.append([*path, link.leader])
    return []


def formation_place(fleet: Fleet, name: str) -> Four:
    """Place of a vehicle in the formation with the first leader at the origin: x, y, z [m], yaw [rad]."""
    x = y = z = yaw = 0.0
    while fleet.vehicles[name].follow:
        link = fleet.vehicles[name].follow[0]
        x, y, z = x + link.offset_m[0], y + link.offset_m[1], z + link.offset_m[2]
        yaw += link.yaw_offset_rad
        name = link.leader
    return (x, y, z, yaw)
