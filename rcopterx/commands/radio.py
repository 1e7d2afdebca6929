"""Radios at the workbench: bind, range check, calibration. Answers are lines on stdin."""

import sys
from typing import Annotated

import typer
from typer import Argument

from rcopterx.commands.fleet_option import FleetOption
from rcopterx.commands.output import print_changes
from rcopterx.commands.parsing import check_known

Vehicle = Annotated[str, Argument(metavar="VEHICLE")]
STEPS = ("signs", "throttle", "trim")


def bind(vehicle: Vehicle, fleet: FleetOption, yes: bool = False) -> None:
    """Bind the receiver of a vehicle to its transmitter. The fleet must be down."""
    from rcopterx.commands.radio_bench import Dialogue, own_model_match, workbench

    with workbench(fleet, vehicle) as (file, _, bench):
        number = own_model_match(file, vehicle)
        protocol = bench.transmitter.protocol
        if not protocol.binds_at_power_up:
            typer.echo(f"{vehicle}: {bench.wait_ready()}")
        if not yes:
            question = (
                f"Switch {vehicle} on in bind mode, 2 to 3 m away, other transmitters off; then press return."
            )
            Dialogue(bench).line(question)
        if protocol.binds_at_power_up:
            typer.echo("Unplug the board now and plug it in again within 30 s.", err=True)
        bench.bind()
        typer.echo(
            f"{vehicle}: bind frames sent with model match {number}, throttle low stored as failsafe; "
            "the receiver's light must be on steadily"
        )


def range_check(vehicle: Vehicle, fleet: FleetOption, seconds: float = 60.0) -> None:
    """Send with reduced power and move the swash plate, which must still respond 30 paces away."""
    from rcopterx.commands.radio_bench import Dialogue, workbench

    with workbench(fleet, vehicle) as (_, _, bench):
        typer.echo(f"{vehicle}: {bench.wait_ready()}")
        typer.echo(
            f"Reduced power for {seconds:g} s; the swash plate tilts to and fro, motors off.", err=True
        )
        dialogue = Dialogue(bench)
        interactive = sys.stdin.isatty()
        bench.range_check(
            seconds,
            dialogue.has_line if interactive else lambda: False,
            [sys.stdin.fileno()] if interactive else [],
        )
    typer.echo(f"{vehicle}: range check over, full power")


def calibrate(
    vehicle: Vehicle, fleet: FleetOption, step: list[str] | None = None, seconds: float = 10.0
) -> None:
    """Calibrate a transmitter and write the result into the fleet file.

    The steps signs and throttle need the fleet down; trim needs the vehicle hovering.
    """
    steps = step or ["signs", "throttle"]
    check_known(steps, STEPS, "step", "--step")
    from rcopterx.commands.radio_bench import Dialogue, check_signs, find_throttle, trim_hover, workbench
    from rcopterx.fleet.editing import check_own, write_calibration
    from rcopterx.fleet.radios import calibration_of
    from rcopterx.fleet.reading import fleet_path
    from rcopterx.fleet.vehicle_models import model_of

    check_own(fleet_path(fleet))
    if {"signs", "throttle"} & set(steps):
        with workbench(fleet, vehicle) as (file, path, bench):
            calibration = calibration_of(file, vehicle)
            typer.echo(f"{vehicle}: {bench.wait_ready()}")
            dialogue = Dialogue(bench)
            if "signs" in steps:
                calibration = check_signs(bench, dialogue, calibration)
            if "throttle" in steps:
                hover_thrust = model_of(file, vehicle).hover_thrust
                calibration = find_throttle(bench, dialogue, calibration, hover_thrust)
            print_changes(vehicle, write_calibration(path, vehicle, calibration))
    if "trim" in steps:
        trim_hover(vehicle, seconds, fleet)


def udev_rules() -> None:
    """Print udev rules for /etc/udev/rules.d, with stable names and permissions of radio modules."""
    from importlib.resources import files

    typer.echo(
        (files("rcopterx.deploy") / "udev" / "60-rcopterx.rules").read_text(encoding="utf-8"), nl=False
    )
