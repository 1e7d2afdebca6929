"""Reads `crazyflies.yaml` and `motion_capture.yaml` of Crazyswarm2; `remarks` get what has no equivalent."""

import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta, Struct

from rcopterx.deploy.new_laboratory import NewVehicle
from rcopterx.deploy.roles.tracker import USUAL_PORTS
from rcopterx.fleet.reading import converted, text_of
from rcopterx.fleet.schema import FleetError, errors_at
from rcopterx.radios.crtp import RadioAddress
from rcopterx.radios.protocol import ProtocolError
from rcopterx.radios.udp import UDP, udp_address
from rcopterx.user_text import TextError, host_and_port, ip_version
from rcopterx_studies.importing.formation import formation_of

NEEDS_YAML = "YAML files need PyYAML: pip install 'rcopterx-studies[crazyswarm]'"
MOTION_CAPTURE_NODE: Final = "/motion_capture_tracking"
ANY_DONGLE: Final = "radio://*/"
SINGLE_MARKERS: Final = "librigidbodytracker"
USED: Final = ("uri", "enabled", "initial_position", "type")
"""Keys of robots that are read, or that every robot has."""


class RobotBattery(Struct, frozen=True):
    """Voltages of a type of vehicles [V]."""

    voltage_warning: Annotated[float, Meta(gt=0)] | None = None
    voltage_critical: Annotated[float, Meta(gt=0)] | None = None


class Robot(Struct, frozen=True):
    """A vehicle, as far as it concerns a fleet file."""

    uri: str
    enabled: bool = True
    initial_position: tuple[float, float, float] = (0.0, 0.0, 0.0)


class _RobotFile(Struct, frozen=True):
    robots: dict[Any, Any]
    robot_types: dict[Any, Any] = {}


class MotionCapture(Struct, frozen=True):
    """The parameters of the motion capture."""

    type: str
    hostname: str = ""


def read_vehicles(path: Path, remarks: list[str]) -> list[NewVehicle]:
    """Return the enabled vehicles of a `crazyflies.yaml`, in its order; `FleetError` names file and robot.

    The first one leads, the others keep their initial distances. Names are those of the rigid bodies.
    """
    document = _document(path, remarks)
    if isinstance(document, dict) and "crazyflies" in document:
        raise FleetError(
            f"{path}: a file of Crazyswarm 1, with vehicles by number; write its vehicles as robots of "
            "Crazyswarm2, with uri: radio://DONGLE/CHANNEL/2M/E7E7E7E7NN, NN being the id as two hexadecimal "
            "digits"
        )
    with errors_at(path):
        file = converted(document, _RobotFile, "")
        robots = {str(name): converted(raw, Robot, f"robots.{name}") for name, raw in file.robots.items()}
    if all_robots := document.get("all"):
        remarks.append(f"all: {', '.join(map(str, all_robots))} not taken over")
    placed: list[NewVehicle] = []
    for (name, robot), raw in zip(robots.items(), file.robots.values(), strict=True):
        if not robot.enabled:
            continue
        remarks += [f"robots.{name}: {remark}" for remark in _losses(raw, file.robot_types)]
        where, position_m = f"robots.{name}.initial_position", robot.initial_position
        if not all(map(math.isfinite, position_m)):
            remarks.append(f"{where}: is not finite, (0, 0, 0) is used; set offset_m")
            position_m = (0.0, 0.0, 0.0)
        elif same := [other.name for other in placed if other.offset_m == position_m]:
            remarks.append(f"{where}: is that of robots.{same[0]}; set offset_m")
        uri = _address(path, name, robot.uri, remarks)
        if same := [other.name for other in placed if other.port == uri]:
            raise FleetError(f"{path}: robots.{name}.uri: {robot.uri!r} is already that of robots.{same[0]}")
        battery = _battery(path, raw, file.robot_types)
        placed.append(NewVehicle(name, name, uri, "crazyflie", position_m, battery))
    if not placed:
        raise FleetError(f"{path}: no robot is enabled")
    return formation_of(path, placed, "cf")


def _address(path: Path, name: str, uri: str, remarks: list[str]) -> str:
    """Return the address of a robot without options of the link, or raise `FleetError`."""
    where = f"robots.{name}.uri"
    address, _, options = uri.partition("?")
    if options:
        remarks.append(f"{where}: {options} not taken over")
    if address.startswith(ANY_DONGLE):
        address = address.replace("*", "0", 1)
        remarks.append(f"{where}: any dongle is not taken over, number 0 is used")
    with errors_at(f"{path}: {where}", ProtocolError):
        if address.startswith(UDP):
            udp_address(address)
        else:
            RadioAddress.of(address)
    return address


def _type_of(robot: dict[str, Any], types: dict[Any, Any]) -> dict[str, Any]:
    """Return the table of a robot's type; empty without one."""
    kind = {str(name): table for name, table in types.items()}.get(str(robot.get("type")))
    return kind if isinstance(kind, dict) else {}


def _battery(path: Path, robot: dict[str, Any], types: dict[Any, Any]) -> dict[str, float]:
    """Return the voltages of a robot's type in the words of a fleet file; or raise `FleetError`."""
    where = f"robot_types.{robot.get('type')}.battery"
    with errors_at(path):
        battery = converted(_type_of(robot, types).get("battery") or {}, RobotBattery, where)
    if (battery.voltage_critical or 0.0) > (battery.voltage_warning or math.inf):
        raise FleetError(f"{path}: {where}: voltage_warning must be at least voltage_critical")
    voltages = {"warn_v": battery.voltage_warning, "land_v": battery.voltage_critical}
    return {name: value for name, value in voltages.items() if value is not None}


def _losses(robot: dict[str, Any], types: dict[Any, Any]) -> Iterator[str]:
    """Yield what a fleet file does not say of a robot."""
    kind = _type_of(robot, types)
    if robot.get("type") is not None and str(robot["type"]) not in map(str, types):
        yield f"its type {robot['type']!r} is not in robot_types"
    capture = kind.get("motion_capture")
    tracking = capture.get("tracking") if isinstance(capture, dict) else None
    if tracking == SINGLE_MARKERS:
        yield (
            f"tracking {SINGLE_MARKERS!r}, from single markers, is not taken over: define a rigid body of "
            "this name in the motion capture"
        )
    elif tracking not in (None, "vendor"):
        yield f"tracking {tracking!r} is not taken over: it needs a rigid body of this name"
    if kind.get("big_quad"):
        yield "big_quad is not taken over: model and limits are those of a Crazyflie, give a type of its own"
    for owner, table in (("", robot), ("its type: ", kind)):
        known = USED if table is robot else ("motion_capture", "big_quad", "battery")
        others = [str(key) for key, value in table.items() if key not in known and value not in (None, {})]
        if others:
            yield f"{owner}{', '.join(others)} not taken over"


def read_tracker(path: Path, remarks: list[str]) -> tuple[str, str]:
    """Return brand and address of the motion capture of a `motion_capture.yaml`, or raise `FleetError`."""
    document: Any = _document(path, remarks)
    where = f"{MOTION_CAPTURE_NODE}.ros__parameters"
    for key in (MOTION_CAPTURE_NODE, "ros__parameters"):
        document = document.get(key) if isinstance(document, dict) else None
    if document is None:
        raise FleetError(f"{path}: {where}: is missing")
    with errors_at(path):
        parameters = converted(document, MotionCapture, where)
    if parameters.type not in USUAL_PORTS:
        raise FleetError(f"{path}: type {parameters.type!r}: allowed are {', '.join(USUAL_PORTS)}")
    if not parameters.hostname:
        raise FleetError(f"{path}: hostname: is missing")
    if document.get("rigid_bodies"):
        remarks.append(f"{path.name}: rigid_bodies, found from single markers, are not taken over")
    host = parameters.hostname.strip()
    if ip_version(host) == 6:
        host = f"[{host}]"
    for address, remark in (
        (f"{host}:{USUAL_PORTS[parameters.type]}", ""),
        (host, f"{path.name}: hostname {parameters.hostname!r} gives the port already: it is used"),
    ):
        with suppress(TextError):
            host_and_port(address)
            remarks += filter(None, [remark])
            return parameters.type, address
    raise FleetError(f"{path}: hostname: {parameters.hostname!r} is neither a name nor an address")


def _document(path: Path, remarks: list[str]) -> Any:
    """Decode a file, with a remark for every key that is there twice, of which YAML keeps the last."""
    try:
        text = text_of(path)
        document = msgspec.yaml.decode(text)
        remarks += [f"{path.name}: {line}" for line in _repeated(text)]
    except ImportError:
        raise FleetError(NEEDS_YAML) from None
    except (FleetError, msgspec.DecodeError) as error:
        raise FleetError(f"{path}: {' '.join(str(error).split())}") from None
    return document


def _repeated(text: str) -> Iterator[str]:
    import yaml

    def visit(node: Any, where: str) -> Iterator[str]:
        if isinstance(node, yaml.SequenceNode):
            for number, item in enumerate(node.value):
                yield from visit(item, f"{where}[{number}]")
        if not isinstance(node, yaml.MappingNode):
            return
        lines: dict[str, int] = {}
        for key, value in node.value:
            place = f"{where}.{key.value}".removeprefix(".")
            line = key.start_mark.line + 1
            if (before := lines.setdefault(place, line)) != line:
                yield f"{place} is there twice, in lines {before} and {line}: only the last one is taken over"
            yield from visit(value, place)

    yield from visit(yaml.compose(text, Loader=yaml.SafeLoader), "")
