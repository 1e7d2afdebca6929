"""Writes the first fleet file of a laboratory, with comments, from a few answers."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import tomlkit

from rcopterx.deploy.fleet_check import check_fleet
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.fleet.radios import MODEL_MATCH_OPTIONS
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.fleet.vehicle_types import vehicle_type

FOLLOWER_OFFSETS_M = ((-0.5, 0.5, 0.0), (-0.5, -0.5, 0.0))
"""Offsets of the second and third vehicle; further ones fly in rows behind them."""


class NewVehicle(NamedTuple):
    """A vehicle."""

    name: str
    subject: str  # its name in the Tracker
    port: str  # serial device, or address of a radio
    offset_m: tuple[float, float, float] | None = None
    """Offset to the first vehicle in formation; None for a place in rows behind it."""
    battery: Mapping[str, float] = {}  # its table `battery`; empty for that of the type


class PlacedVehicle(NamedTuple):
    """A vehicle of other software."""

    name: str  # which is its name in the Tracker, too
    port: str | None  # address of its radio; None for a simulated radio
    position_m: Sequence[float]
    battery: Mapping[str, float] = {}  # its table in a fleet file


def formation_of(source: Path, placed: Sequence[PlacedVehicle], prefix: str) -> list[NewVehicle]:
    """Return vehicles that keep the distances of their positions to the first one, which leads.

    Names get small letters, and the prefix if they do not begin with a letter. Raises `FleetError` if two are
    the same then.
    """
    vehicles = []
    for name, port, position_m, battery in placed:
        short = name_of(name)
        short = short if short[:1].isalpha() else f"{prefix}{short}"
        x, y, z = (
            round(float(own - of_first), 4)
            for own, of_first in zip(position_m, placed[0].position_m, strict=True)
        )
        vehicles.append(NewVehicle(short, name, port or f"radio-{short}", (x, y, z), battery))
    if len({vehicle.name for vehicle in vehicles}) < len(vehicles):
        raise FleetError(f"{source}: names of vehicles differ only in capital letters or signs")
    return vehicles


class NewLaboratory(NamedTuple):
    """The answers about a laboratory."""

    name: str  # name of the fleet
    tracker: str  # HOST:PORT of the Tracker's data stream
    volume_min_m: tuple[float, float, float]
    volume_max_m: tuple[float, float, float]  # corners of the flight volume in the Tracker's frame
    protocol: str | None  # protocol of all radio modules; None for that of the type
    type: str  # type of all vehicles
    vehicles: Sequence[NewVehicle]  # the first one leads
    brand: str = "vicon"  # kind of the motion capture
    rate_hz: float | None = None  # capture rate; None where the motion capture reports it
    simulator: str = ""  # text of the sections of the simulator; empty with hardware

    @property
    def binds(self) -> bool:
        """Whether receivers are bound to radio modules and calibrated."""
        protocol = self.protocol or vehicle_type(self.type).file.transmitter.protocol
        return protocol in MODEL_MATCH_OPTIONS


def write_fleet_file(path: Path, laboratory: NewLaboratory) -> None:
    """Write a fleet file that passes every check without hardware, or raise `FleetError`."""
    text = fleet_file_text(laboratory, path)
    fleet = parse_fleet(text)
    check_fleet(fleet, run_directory(fleet.name, None))
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise FleetError(f"{path}: exists already and is not overwritten") from None


def fleet_file_text(laboratory: NewLaboratory, path: Path) -> str:
    """Return the text of the file, with comments on the next steps."""
    first = laboratory.vehicles[0].name
    bench = laboratory.binds and not laboratory.simulator
    commands = ("bind", "range-check", "calibrate") if bench else ()
    steps = [f"{command} {first} -f {path}" for command in commands] + [f"up {path}"]
    comments = "\n".join(f"#     rcopterx {step}" for step in steps)
    rate = "" if laboratory.rate_hz is None else f"rate_hz = {laboratory.rate_hz:g}\n"
    parts = [
        f"""\
# Fleet of our laboratory. Every key, its unit, its default and its limits: docs/fleet_file.md
# Next steps, in this order, with the fleet down:
{comments}

name = {quoted(laboratory.name)}

# Vehicles that leave this box are landed. Metres, in the Tracker's world, z up; the floor is at z = 0.
# Keep a margin to walls and people: nets, not the software, stop a helicopter without a radio.
[volume]
min_m = {list(laboratory.volume_min_m)}
max_m = {list(laboratory.volume_max_m)}

[tracker]
brand = {quoted(laboratory.brand)}
address = {quoted(laboratory.tracker)}
{rate}"""
    ]
    if laboratory.simulator:
        parts.append(laboratory.simulator)
    parts += [
        _vehicle_text(vehicle, number, laboratory) for number, vehicle in enumerate(laboratory.vehicles)
    ]
    return "\n".join(parts)


def name_of(text: str) -> str:
    """Return text with the letters and signs of names in a fleet file."""
    return re.sub(r"[^a-z0-9_]", "_", text.lower())


def quoted(text: str) -> str:
    """Return text as a TOML basic string."""
    return tomlkit.string(text).as_string()


def _vehicle_text(vehicle: NewVehicle, number: int, laboratory: NewLaboratory) -> str:
    key = tomlkit.key(vehicle.name).as_string()
    lines = [
        f"[vehicles.{key}]",
        f"type = {quoted(laboratory.type)}    # rcopterx types lists all",
        f"subject = {quoted(vehicle.subject)}    # its name in the Tracker",
    ]
    if number > 0:
        row, side = divmod(number - 1, len(FOLLOWER_OFFSETS_M))
        in_rows = [value * (row + 1) for value in FOLLOWER_OFFSETS_M[side]]
        offset_m = in_rows if vehicle.offset_m is None else list(vehicle.offset_m)
        leader = laboratory.vehicles[0].name
        lines += [
            "# In formation, once it has hovered alone; metres along the axes of the Tracker.",
            f"# follow = [{{ leader = {quoted(leader)}, offset_m = {offset_m} }}]",
        ]
    lines += [
        "",
        f"[vehicles.{key}.transmitter]",
        f"port = {quoted(vehicle.port)}",
        *([] if laboratory.protocol is None else [f"protocol = {quoted(laboratory.protocol)}"]),
    ]
    if laboratory.binds:
        lines += [
            f"model_match = {number + 1}    # binds the receiver to this transmitter: one for every vehicle",
            "# low_power = true    # often enough indoors",
        ]
    if vehicle.battery:
        lines += [
            "",
            f"[vehicles.{key}.battery]",
            *(f"{name} = {v:g}" for name, v in vehicle.battery.items()),
        ]
    lines.append("")
    return "\n".join(lines)
