"""The first fleet file of a laboratory: `new-lab` asks for it, `import` reads it from other software."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar, get_args

import typer
from typer import Argument, Option

from rcopterx.commands.parsing import three
from rcopterx.user_text import TextError, host_and_port

if TYPE_CHECKING:
    from rcopterx.deploy.new_laboratory import NewVehicle


T = TypeVar("T")

LOOK_S = 3.0
MOTION_CAPTURE = "motion_capture.yaml"

NewFleetFile = Annotated[Path, Argument(metavar="FILE", help="Fleet file to write, for instance lab.toml.")]
LowerCorner = Annotated[
    str, Option("--volume-min", metavar="X,Y,Z", help="Lower corner of the flight volume in metres.")
]
UpperCorner = Annotated[
    str, Option("--volume-max", metavar="X,Y,Z", help="Upper corner of the flight volume in metres.")
]

import_ = typer.Typer(add_completion=False, no_args_is_help=True)


@import_.callback()
def _import() -> None:
    """Write a fleet file from files of other software."""


def new_lab(
    file: NewFleetFile,
    vehicle_type: Annotated[
        str, Option("--type", metavar="NAME", help="Type of the vehicles; rcopterx types lists them.")
    ] = "coaxial",
    protocol: Annotated[
        str | None,
        Option(
            metavar="multi|dsm2_serial|dsmp|ppm|crazyflie|mavlink",
            help="Protocol of the radio modules; by default that of the type.",
        ),
    ] = None,
) -> None:
    """Write the fleet file of a laboratory with hardware; asks for addresses, vehicles and the volume."""
    from rcopterx.deploy.new_laboratory import NewLaboratory, name_of, write_fleet_file
    from rcopterx.fleet.vehicle_types import type_names

    name = name_of(file.stem)
    _check(file, name, vehicle_type, protocol)
    _print("vehicle types, for --type", type_names())
    address = _prompt("Tracker, HOST:PORT", "127.0.0.1:801", _address)
    vehicles = _prompt_vehicles(address)
    low_m = _prompt("Lower corner of the volume, X,Y,Z in metres", "-1.5,-1.5,0", three)
    high_m = _prompt("Upper corner of the volume, X,Y,Z in metres", "1.5,1.5,2", three)
    write_fleet_file(file, NewLaboratory(name, address, low_m, high_m, protocol, vehicle_type, vehicles))
    typer.echo(f"{file}: {', '.join(one.name for one in vehicles)}; its first lines list the next steps")


def _check(file: Path, name: str, vehicle_type: str, protocol: str | None) -> None:
    """Check what no answer changes, before the first question; raises `FleetError`."""
    from rcopterx.bus.message import Name
    from rcopterx.fleet.reading import converted
    from rcopterx.fleet.schema import FleetError, ProtocolName, check_known
    from rcopterx.fleet.vehicle_types import type_names

    if file.exists():
        raise FleetError(f"{file}: exists already and is not overwritten")
    if not file.parent.is_dir():
        raise FleetError(f"{file.parent}: no such directory")
    converted(name, Name, f"{file}: name of the fleet")
    check_known("--type", "type", vehicle_type, type_names())
    if protocol is not None:
        check_known("--protocol", "protocol", protocol, get_args(ProtocolName))


def _prompt_vehicles(address: str) -> "list[NewVehicle]":
    """Ask for the subjects that fly and their radios."""
    from rcopterx.deploy.new_laboratory import NewVehicle
    from rcopterx.transmitter_gateway.adapters import plugged_in

    seen = _subjects_of(address)
    adapters = plugged_in()
    _print("serial adapters", [f"{one.port}  ({one.device}, {one.description})" for one in adapters])
    wanted = _prompt("Subjects that fly, separated by commas", ",".join(seen) or None, str)
    subjects = [text.strip() for text in wanted.split(",") if text.strip()]
    ports = (one.port for one in adapters)
    return [
        NewVehicle(f"h{number}", subject, _prompt(f"Serial device of {subject}", next(ports, None), str))
        for number, subject in enumerate(subjects, start=1)
    ]


def _subjects_of(address: str) -> list[str]:
    """Subjects that the Tracker lists; none, with the reason printed, if it does not answer."""
    from rcopterx.vicon_gateway.client import DataStreamClient

    host, port = host_and_port(_address(address))
    with DataStreamClient(host, port) as client:
        if (frame := client.next_frame(LOOK_S)) is None:
            why = client.state.last_error or client.state.doing
            typer.echo(f"{address}: {why}; type the names of the subjects", err=True)
            return []
    lines = [f"{one.name}{'  (not seen now)' if one.occluded else ''}" for one in frame.subjects]
    _print("subjects of the Tracker", lines)
    return [one.name for one in frame.subjects]


def _address(text: str) -> str:
    try:
        host_and_port(text)
    except TextError as error:
        raise typer.BadParameter(str(error)) from None
    return text


def _print(what: str, found: list[str]) -> None:
    typer.echo(f"{what}:" if found else f"{what}: none", err=True)
    for line in found:
        typer.echo(f"    {line}", err=True)


def _prompt(question: str, default: str | None, read: Callable[[str], T]) -> T:
    """Answer from the terminal or from a pipe, repeated until it is valid; raises FleetError without one."""
    from rcopterx.fleet.schema import FleetError

    try:
        answer: T = typer.prompt(question, default=default, err=True, value_proc=read)
    except typer.Abort:
        raise FleetError(f"no answer to {question!r}") from None
    return answer


@import_.command()
def crazyswarm2(
    source: Annotated[
        Path, Argument(metavar="CRAZYFLIES", exists=True, dir_okay=False, help="File crazyflies.yaml.")
    ],
    file: NewFleetFile,
    motion_capture: Annotated[
        Path | None, Option(metavar="FILE", help=f"Default: {MOTION_CAPTURE} beside the other one.")
    ] = None,
    rate_hz: Annotated[
        float | None,
        Option("--rate", metavar="HZ", help="Capture rate; only a Vicon Tracker reports its own."),
    ] = None,
    volume_min: LowerCorner = "-1.5,-1.5,0",
    volume_max: UpperCorner = "1.5,1.5,2",
) -> None:
    """Write the fleet file of the enabled Crazyflies of Crazyswarm2, with their motion capture."""
    from rcopterx.deploy.crazyswarm import read_tracker, read_vehicles
    from rcopterx.deploy.new_laboratory import NewLaboratory, name_of, write_fleet_file

    remarks: list[str] = []
    vehicles = read_vehicles(source, remarks)
    brand, address = read_tracker(motion_capture or source.with_name(MOTION_CAPTURE), remarks)
    name, corners = name_of(file.stem), (three(volume_min), three(volume_max))
    laboratory = NewLaboratory(name, address, *corners, None, "crazyflie", vehicles, brand, rate_hz)
    write_fleet_file(file, laboratory)
    for remark in remarks:
        typer.echo(f"remark: {remark}", err=True)
    typer.echo(f"{file}: {', '.join(one.name for one in vehicles)}; its first lines list the next steps")
