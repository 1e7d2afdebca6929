"""The first fleet file of a laboratory: `new-lab` asks for it."""

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from rcopterx.commands.fleet_option import shared_option
from rcopterx.commands.parsing import three
from rcopterx.user_text import host_and_port, number_in

if TYPE_CHECKING:
    from rcopterx.deploy.new_laboratory import NewLaboratory, NewVehicle

LOOK_S = 3.0
RATE_HZ: Final = 100.0
LOW: Final = "-1.5,-1.5,0"
HIGH: Final = "1.5,1.5,2"
CRAZYFLIE: Final = "radio://0/80/2M/E7E7E7E7"  # and two digits

NewFleetFile = Annotated[Path, shared_option("new_fleet_file")]


def new_lab(file: NewFleetFile) -> None:
    """Write the fleet file of a laboratory with hardware; asks for addresses, vehicles and the volume."""
    from rcopterx.bus.message import Name
    from rcopterx.deploy.new_laboratory import name_of, write_fleet_file
    from rcopterx.fleet.reading import converted
    from rcopterx.fleet.schema import FleetError

    if file.exists():
        raise FleetError(f"{file}: exists already and is not overwritten")
    if not file.parent.is_dir():
        raise FleetError(f"{file.parent}: no such directory")
    name = name_of(file.stem)
    converted(name, Name, f"{file}: name of the fleet")
    dialogue = Dialogue(name)
    dialogue.ask_for_motion_capture()
    dialogue.ask_for_vehicles()
    dialogue.ask_for_volume()
    write_fleet_file(file, dialogue.laboratory)
    names = ", ".join(vehicle.name for vehicle in dialogue.laboratory.vehicles)
    typer.echo(f"{file}: {names}; next, with the fleet down:")
    for step in dialogue.laboratory.next_steps(file):
        typer.echo(f"    {step}")


class Dialogue:
    """Asks about a laboratory; what its fleet file may not contain is requested again at once."""

    def __init__(self, name: str) -> None:
        from rcopterx.deploy.new_laboratory import NewLaboratory, NewVehicle
        from rcopterx.transmitter_gateway.adapters import plugged_in

        self._adapters = plugged_in()
        self._first = NewVehicle("h1", "h1", "radio-h1", "coaxial")
        self.laboratory = NewLaboratory(name, "127.0.0.1:801", three(LOW), three(HIGH), [self._first])
        """What the answers so far say."""

    def _ask(self, question: str, default: str | None, change: "Callable[[str], NewLaboratory]") -> None:
        """Change the laboratory by an answer from terminal or pipe; raises `FleetError` without one."""
        from rcopterx.fleet.schema import FleetError

        def changed(text: str) -> "NewLaboratory":
            try:
                laboratory = change(text.strip())
                laboratory.check()
            except ValueError as error:
                raise typer.BadParameter(str(error)) from None
            return laboratory

        try:
            self.laboratory = typer.prompt(question, default=default, err=True, value_proc=changed)
        except typer.Abort:
            raise FleetError(f"no answer to {question!r}") from None

    def ask_for_motion_capture(self) -> None:
        """Ask for brand, address and rate of the motion capture."""
        from rcopterx.deploy.roles.tracker import BRANDS, USUAL_PORTS

        def of_brand(text: str) -> "NewLaboratory":
            address, rate_hz = f"127.0.0.1:{USUAL_PORTS.get(text, 1)}", None if text == "vicon" else RATE_HZ
            return self.laboratory._replace(brand=text, tracker=address, rate_hz=rate_hz)

        def of_rate(text: str) -> "NewLaboratory":
            return self.laboratory._replace(rate_hz=number_in(text, "rate"))

        _print("brands of motion capture", [f"{name:10} {BRANDS[name].text}" for name in USUAL_PORTS])
        self._ask("Brand of the motion capture", "vicon", of_brand)
        usual = self.laboratory.tracker
        self._ask("Its address, HOST:PORT", usual, lambda text: self.laboratory._replace(tracker=text))
        if self.laboratory.rate_hz is not None:
            self._ask("Its rate in Hz", f"{RATE_HZ:g}", of_rate)

    def ask_for_vehicles(self) -> None:
        """Ask for the subjects that fly, and for type and radio of each."""
        from rcopterx.fleet.vehicle_types import type_names, vehicle_type

        def of_subjects(text: str) -> "NewLaboratory":
            subjects = [part.strip() for part in text.split(",") if part.strip()]
            vehicles = [
                self._first._replace(name=f"h{number}", subject=subject, port=f"radio-h{number}")
                for number, subject in enumerate(subjects, 1)
            ]
            if not vehicles:
                raise typer.BadParameter("at least one subject is needed")
            return self.laboratory._replace(vehicles=vehicles)

        seen = _subjects_of(self.laboratory.tracker) if self.laboratory.brand == "vicon" else []
        self._ask("Subjects that fly, separated by commas", ",".join(seen) or None, of_subjects)
        _print(
            "serial adapters", [f"{one.port}  ({one.device}, {one.description})" for one in self._adapters]
        )
        _print("types of vehicles", [f"{name:18} {vehicle_type(name).file.text}" for name in type_names()])
        before: list[NewVehicle] = []
        for vehicle in self.laboratory.vehicles:
            self._ask_for_vehicle(vehicle, before)
            before = [*self.laboratory.vehicles]

    def _ask_for_vehicle(self, vehicle: "NewVehicle", before: "Sequence[NewVehicle]") -> None:
        """Ask for type and radio of a vehicle, which flies with those before it."""
        taken = {one.port for one in before}
        ports = [one.port for one in self._adapters if one.port not in taken]
        addresses = [f"{CRAZYFLIE}{number:02X}" for number in range(1, 256)]

        def of_type(text: str) -> "NewLaboratory":
            own = vehicle._replace(type=text)
            port = next(iter(ports), own.port)
            if own.protocol == "crazyflie":
                port = next(address for address in addresses if address not in taken)
            return self.laboratory._replace(vehicles=[*before, own._replace(port=port)])

        self._ask(f"Type of {vehicle.subject}", before[-1].type if before else vehicle.type, of_type)
        own = self.laboratory.vehicles[-1]
        what = "Address of" if own.protocol == "crazyflie" else "Serial device of the radio of"
        self._ask(
            f"{what} {own.subject}",
            None if own.port == vehicle.port else own.port,
            lambda text: self.laboratory._replace(vehicles=[*before, own._replace(port=text)]),
        )

    def ask_for_volume(self) -> None:
        """Ask for the corners of the flight volume."""

        def of_low(text: str) -> "NewLaboratory":
            low_m = three(text)
            x, y, z = (max(high, low + 1.0) for low, high in zip(low_m, three(HIGH), strict=True))
            return self.laboratory._replace(volume_min_m=low_m, volume_max_m=(x, y, z))

        self._ask("Lower corner of the volume, X,Y,Z in metres", LOW, of_low)
        upper = "Upper corner of the volume, X,Y,Z in metres"
        self._ask(upper, HIGH, lambda text: self.laboratory._replace(volume_max_m=three(text)))


def _subjects_of(address: str) -> list[str]:
    """Subjects that the Tracker lists; none, with the reason printed, if it does not answer."""
    from rcopterx.vicon_gateway.client import DataStreamClient

    with closing(DataStreamClient(*host_and_port(address))) as client:
        if (frame := client.next_frame(LOOK_S)) is None:
            why = client.state.last_error or client.state.doing
            typer.echo(f"{address}: {why}; type the names of the subjects", err=True)
            return []
    lines = [f"{one.name}{'  (not seen now)' if one.occluded else ''}" for one in frame.subjects]
    _print("subjects of the Tracker", lines)
    return [one.name for one in frame.subjects]


def _print(what: str, found: list[str]) -> None:
    typer.echo(f"{what}:" if found else f"{what}: none", err=True)
    for line in found:
        typer.echo(f"    {line}", err=True)
