"""Writes the first fleet file of a laboratory, with comments, from a few answers."""

import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Final, NamedTuple

import tomlkit

from rcopterx.deploy.fleet_check import check_fleet
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.deploy.roles.ports import check_ports
from rcopterx.deploy.roles.tracker import OWN_CLIENT, brand_of, tracker_address
from rcopterx.fleet.consistency import check_periods
from rcopterx.fleet.radios import MODEL_MATCH_OPTIONS
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.vehicle_types import vehicle_type

BENCH: Final = ("bind", "range-check", "calibrate")
FIRMWARE_STEPS: Final[Mapping[str, Sequence[str]]] = {
    "crazyflie": ("pip install 'rcopterx[crazyflie]'", "give every Crazyflie its address: docs/crazyflie.md"),
    "mavlink": ("pip install 'rcopterx[mavlink]'", "set the parameters of the autopilot: docs/mavlink.md"),
}
FOLLOWER_OFFSETS_M = ((-0.5, 0.5, 0.0), (-0.5, -0.5, 0.0))
"""Offsets of the second and third vehicle; further ones fly in rows behind them."""


class NewVehicle(NamedTuple):
    """A vehicle."""

    name: str
    subject: str  # its name in the Tracker
    port: str  # serial device, or address of a radio
    type: str
    offset_m: Sequence[float] | None = None
    """Offset to the first vehicle in formation; None for a place in rows behind it."""
    battery: Mapping[str, float] = {}  # its table `battery`; empty for that of the type

    @property
    def protocol(self) -> str:
        """Protocol of its radio; raises `FleetError` for an unknown type."""
        return vehicle_type(self.type).file.transmitter.protocol


class NewLaboratory(NamedTuple):
    """The answers about a laboratory."""

    name: str  # name of the fleet
    tracker: str  # HOST:PORT of the Tracker's data stream
    volume_min_m: tuple[float, float, float]
    volume_max_m: tuple[float, float, float]  # corners of the flight volume in the Tracker's frame
    vehicles: Sequence[NewVehicle]  # the first one leads
    brand: str = OWN_CLIENT  # kind of the motion capture
    rate_hz: float | None = None  # capture rate; None where the motion capture reports it
    simulator: str = ""  # text of the sections of the simulator; empty with hardware

    def next_steps(self, path: Path) -> list[str]:
        """Return what comes after writing the file, in order; for each type by its first vehicle."""
        firsts: dict[str, NewVehicle] = {}
        for vehicle in self.vehicles:
            firsts.setdefault(vehicle.type, vehicle)
        steps = [] if self.brand == OWN_CLIENT else ["pip install 'rcopterx[mocap]'"]
        for vehicle in () if self.simulator else firsts.values():
            steps += FIRMWARE_STEPS.get(vehicle.protocol, ())
            if vehicle.protocol in MODEL_MATCH_OPTIONS:
                steps += [f"rcopterx {what} {vehicle.name} -f {path}" for what in BENCH]
        return [*steps, f"rcopterx up {path}", "rcopterx check"]

    def check(self) -> FleetFile:
        """Return the fleet, checked as far as no kernels are needed; `FleetError` names the wrong answer."""
        fleet = parse_fleet(fleet_file_text(self, Path()))
        tracker_address(fleet)
        brand_of(fleet)
        check_periods(fleet)
        check_ports(fleet, run_directory(fleet.name, None))
        return fleet


def write_fleet_file(path: Path, laboratory: NewLaboratory) -> None:
    """Write a fleet file that passes every check without hardware, or raise `FleetError`."""
    fleet = laboratory.check()
    check_fleet(fleet, run_directory(fleet.name, None))
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(fleet_file_text(laboratory, path))
    except FileExistsError:
        raise FleetError(f"{path}: exists already and is not overwritten") from None


def fleet_file_text(laboratory: NewLaboratory, path: Path) -> str:
    """Return the text of the file, with comments on the next steps."""
    template = (files(__package__) / "new_fleet.template").read_text("utf-8")
    head = template.format(
        steps="\n".join(f"#     {step}" for step in laboratory.next_steps(path)),
        name=quoted(laboratory.name),
        min_m=list(laboratory.volume_min_m),
        max_m=list(laboratory.volume_max_m),
        brand=quoted(laboratory.brand),
        address=quoted(laboratory.tracker),
    )
    rate = "" if laboratory.rate_hz is None else f"rate_hz = {laboratory.rate_hz:g}\n"
    vehicles = (_vehicle_text(one, number, laboratory) for number, one in enumerate(laboratory.vehicles))
    return "\n".join((head + rate, *filter(None, [laboratory.simulator]), *vehicles))


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
        f"type = {quoted(vehicle.type)}    # rcopterx types lists all",
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
    lines += ["", f"[vehicles.{key}.transmitter]", f"port = {quoted(vehicle.port)}"]
    if vehicle.protocol in MODEL_MATCH_OPTIONS:
        lines += [
            f"model_match = {number + 1}    # binds the receiver to this transmitter: one for every vehicle",
            "# low_power = true    # often enough indoors",
            '# protocol = "dsm2_serial"    # of a radio that is no Multiprotocol module: docs/hardware.md',
        ]
    if vehicle.battery:
        lines += ["", f"[vehicles.{key}.battery]", *(f"{k} = {v:g}" for k, v in vehicle.battery.items())]
    lines.append("")
    return "\n".join(lines)
