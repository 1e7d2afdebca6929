"""Reads the configuration of Crazyswarm2, `crazyflies.yaml` and `motion_capture.yaml`."""

from pathlib import Path
from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta, Struct, field

from rcopterx.deploy.new_laboratory import NewVehicle, PlacedVehicle, formation_of
from rcopterx.deploy.roles.tracker import USUAL_PORTS
from rcopterx.fleet.reading import text_of
from rcopterx.fleet.schema import FleetError

NEEDS_YAML = "YAML files need PyYAML: pip install 'rcopterx[crazyswarm]'"
_PORTS = {"vicon": 801, **USUAL_PORTS}
"""Ports that Crazyswarm2 leaves to the library, by motion capture that this package reads."""

T = TypeVar("T")


class Robot(Struct, frozen=True):
    """A vehicle, as far as it concerns a fleet file."""

    uri: str
    enabled: bool = True
    initial_position: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Robots(Struct, frozen=True):
    """The file of vehicles."""

    robots: Annotated[dict[str, Robot], Meta(min_length=1)]


class MotionCapture(Struct, frozen=True):
    """The parameters of the motion capture."""

    type: str
    hostname: str = ""


class _Parameters(Struct, frozen=True):
    ros__parameters: MotionCapture


class _MotionCaptureFile(Struct, frozen=True):
    node: _Parameters = field(name="/motion_capture_tracking")


def read_vehicles(path: Path) -> list[NewVehicle]:
    """Return the enabled vehicles of a `crazyflies.yaml`, in its order.

    The first one leads; the others keep the distances of the initial positions. A robot's name is that of its
    rigid body. Raises `FleetError`: the file cannot be read, PyYAML is not installed, or no vehicle can be
    used; says which file and why.
    """
    robots = {name: robot for name, robot in _decoded(path, Robots).robots.items() if robot.enabled}
    if not robots:
        raise FleetError(f"{path}: no robot is enabled")
    placed = [PlacedVehicle(name, robot.uri, robot.initial_position) for name, robot in robots.items()]
    return formation_of(path, placed, "cf")


def read_tracker(path: Path) -> tuple[str, str]:
    """Return brand and address of the motion capture of a `motion_capture.yaml`, or raise `FleetError`."""
    parameters = _decoded(path, _MotionCaptureFile).node.ros__parameters
    if parameters.type not in _PORTS:
        raise FleetError(f"{path}: type {parameters.type!r}: allowed are {', '.join(_PORTS)}")
    if not parameters.hostname:
        raise FleetError(f"{path}: hostname: is missing")
    return parameters.type, f"{parameters.hostname}:{_PORTS[parameters.type]}"


def _decoded(path: Path, kind: type[T]) -> T:
    try:
        return msgspec.yaml.decode(text_of(path), type=kind)
    except ImportError:
        raise FleetError(NEEDS_YAML) from None
    except (FleetError, msgspec.DecodeError) as error:
        raise FleetError(f"{path}: {' '.join(str(error).split())}") from None
