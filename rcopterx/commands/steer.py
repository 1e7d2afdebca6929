"""Commands to a running fleet."""

import math
from typing import Annotated, Literal

import typer
from typer import Argument

from rcopterx.commands.fleet_option import RunningFleetOption, running_fleet, vehicles_beginning
from rcopterx.commands.parsing import check_known, settings_of, three

Vehicles = Annotated[
    list[str] | None,
    Argument(metavar="[VEHICLE]...", help="Default: all vehicles.", autocompletion=vehicles_beginning),
]
Vehicle = Annotated[str, Argument(metavar="VEHICLE", autocompletion=vehicles_beginning)]


def arm(vehicles: Vehicles = None, fleet: RunningFleetOption = None) -> None:
    """Arm vehicles: let their agents command the transmitters. Rotors stay still until take-off."""
    with running_fleet(fleet, vehicles) as running:
        running.wait_ready(vehicles or None, timeout_s=3.0)
        running.arm(vehicles or None)
        typer.echo("armed")


def disarm(vehicles: list[str] | None = None, every: bool = False, fleet: RunningFleetOption = None) -> None:
    """Keep the throttle low until armed again; refused in the air, where land and kill apply."""
    if bool(vehicles) == every:
        raise typer.BadParameter("name the vehicles, or give --all", param_hint="[VEHICLE]...")
    from rcopterx.ground_station.scripting.vehicle import RefusedError

    with running_fleet(fleet, vehicles) as running:
        names = vehicles or list(running.file.vehicles)
        running.wait_for_status(names)
        if airborne := [name for name in names if running[name].state.airborne]:
            raise RefusedError(f"{', '.join(airborne)} in the air: land first; only kill cuts the motors")
        for name in names:
            running[name].disarm()
        typer.echo("disarmed")


def takeoff(vehicles: Vehicles = None, height: float = 1.0, fleet: RunningFleetOption = None) -> None:
    """Arm, take off, and wait until the vehicles fly."""
    with running_fleet(fleet, vehicles) as running:
        before = running.crowded_hosts()
        for line in before:
            typer.echo(line, err=True)
        behind = running.take_off(vehicles or None, height)
        for line in running.crowded_hosts():
            if line not in before:
                typer.echo(line, err=True)
        for line in behind:
            typer.echo(f"stays on the floor: {line}", err=True)
        typer.echo("flying")


def goto(
    vehicle: Vehicle,
    x: float,
    y: float,
    z: float,
    yaw: float = 0.0,
    turns: int = 0,
    fleet: RunningFleetOption = None,
) -> None:
    """Send a vehicle that leads to a set point: goto h1 -0.5 0 1."""
    with running_fleet(fleet, [vehicle]) as running:
        running[vehicle].go_to((x, y, z), math.radians(yaw), turns)
        typer.echo(f"{vehicle}: on the way to {x:g} {y:g} {z:g} m, {yaw:g} deg")


def follow(
    vehicle: Vehicle,
    leader: str,
    offset: str = "0,0,0",
    yaw: float = 0.0,
    frame: str = "inertial",
    fleet: RunningFleetOption = None,
) -> None:
    """Follow another vehicle, or a tracked subject of the fleet file, in flight or on the floor."""
    check_known([frame], ("inertial", "heading"), "frame", "--frame")
    if vehicle == leader:
        raise typer.BadParameter(f"{vehicle} cannot follow itself, name another vehicle", param_hint="LEADER")
    offset_m = three(offset)
    with running_fleet(fleet, [vehicle]) as running:
        check_known([leader], running.file.tracked, "vehicle", "LEADER")
        typer.echo(running[vehicle].follow(leader, offset_m, math.radians(yaw), frame))


def lead(vehicle: Vehicle, fleet: RunningFleetOption = None) -> None:
    """Stop following; the vehicle holds its position."""
    with running_fleet(fleet, [vehicle]) as running:
        running[vehicle].lead()
        typer.echo(f"{vehicle}: leads")


def swap(first: Vehicle, second: Vehicle, fleet: RunningFleetOption = None) -> None:
    """Exchange the roles of two vehicles, for instance leader and follower; all keep their places."""
    with running_fleet(fleet, [first, second]) as running:
        typer.echo("\n".join(running.swap(first, second)))


def promote(vehicle: Vehicle, fleet: RunningFleetOption = None) -> None:
    """Make a vehicle the leader of its whole formation; all keep their places."""
    with running_fleet(fleet, [vehicle]) as running:
        typer.echo("\n".join(running.promote(vehicle)))


def formation(
    shape: str, leader: str, spacing: float = 0.8, assign: bool = False, fleet: RunningFleetOption = None
) -> None:
    """Bring all flying vehicles into a formation behind one that leads: formation line h1 --assign."""
    # Numerical libraries take longer to import than the command line.
    from rcopterx.formation.shapes import SHAPES

    check_known([shape], SHAPES, "formation", "SHAPE")
    with running_fleet(fleet) as running:
        check_known([leader], running.file.tracked, "vehicle", "LEADER")
        typer.echo("\n".join(running.form(shape, leader, spacing, assign=assign)))


def move(vehicle: Vehicle, to: str, fleet: RunningFleetOption = None) -> None:
    """Move the agent of a vehicle to another host, also in flight, where a warm agent takes over."""
    with running_fleet(fleet, [vehicle]) as running:
        running.wait_for_status([vehicle])
        running[vehicle].move(to)
        typer.echo(f"the agent of {vehicle} runs on {to}")


def tune(
    vehicle: Vehicle,
    settings: list[str] | None = None,
    controller: str | None = None,
    estimator: str | None = None,
    fleet: RunningFleetOption = None,
) -> None:
    """Change controller, estimator, weights, limits or horizon in flight: tune h2 horizon=30."""
    named = settings_of(settings or (), "[NAME=VALUE]...")
    of_estimator = {name: value for name, value in named.items() if name.startswith("estimator.")}
    of_controller = {name: value for name, value in named.items() if name not in of_estimator}
    of_estimator = {name.removeprefix("estimator."): value for name, value in of_estimator.items()}
    if not (settings or controller or estimator):
        raise typer.BadParameter("nothing to change: give settings, --controller or --estimator")
    with running_fleet(fleet, [vehicle]) as running:
        now = running[vehicle].tune(controller, estimator, of_estimator, **of_controller)
        typer.echo(f"{vehicle}: {now}")


def join(vehicle: Vehicle, height: float = 1.0, fleet: RunningFleetOption = None) -> None:
    """Take off with a vehicle that was left out and join its formation; the others fly on."""
    with running_fleet(fleet, [vehicle]) as running:
        typer.echo(running.join(vehicle, height))


def leave(vehicle: Vehicle, fleet: RunningFleetOption = None) -> None:
    """Land a vehicle and end its agent; the others fly on."""
    with running_fleet(fleet, [vehicle]) as running:
        running.leave(vehicle)
        typer.echo(f"{vehicle} has left")


def land(vehicles: Vehicles = None, fleet: RunningFleetOption = None) -> None:
    """Land, wait until the vehicles are on the floor, and disarm."""
    with running_fleet(fleet, vehicles) as running:
        running.land(vehicles or None)
        typer.echo("landed")


def suspend(fleet: RunningFleetOption = None) -> None:
    """Let all vehicles come to rest on their ways, at one frame, until resume."""
    with running_fleet(fleet) as running:
        typer.echo("\n".join(running.suspend()))


def resume(fleet: RunningFleetOption = None) -> None:
    """Let all vehicles go on from where they were suspended, at one frame."""
    with running_fleet(fleet) as running:
        typer.echo("\n".join(running.resume()))


def home(vehicles: Vehicles = None, fleet: RunningFleetOption = None) -> None:
    """Fly back to where the vehicles took off, clear of each other, and land there."""
    with running_fleet(fleet, vehicles) as running:
        running.home(vehicles or None)
        typer.echo("home")


def zone(
    name: str | None = None,
    low: str | None = None,
    high: str | None = None,
    cylinder: bool = False,
    margin: float = 0.2,
    remove: bool = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Add, move or remove a keep-out zone in flight, or list all: zone table -0.5,0,0 0.5,0.4,0.8."""
    from rcopterx.bus.messages import Zone

    if name is not None and not remove and (low is None or high is None):
        raise typer.BadParameter("give two corners, or --remove", param_hint="NAME")
    made = None
    if low is not None and high is not None and not remove:
        shape: Literal["box", "cylinder"] = "cylinder" if cylinder else "box"
        made = Zone(min_m=three(low), max_m=three(high), shape=shape, margin_m=margin)
    with running_fleet(fleet) as running:
        if name is not None:
            running.set_zone(name, made)
            typer.echo(f"{name}: removed" if made is None else f"{name}: vehicles keep out of it")
            return
        running.wait_for_status()
        for known, one in running.zones.zones.items():
            corners = " to ".join(",".join(f"{at_m:g}" for at_m in at) for at in (one.min_m, one.max_m))
            typer.echo(f"{known}: {one.shape} from {corners} m, margin {one.margin_m:g} m")


def light(vehicle: Vehicle, colour: str, fleet: RunningFleetOption = None) -> None:
    """Show a colour on the LEDs of a vehicle: light h1 255,0,0."""
    red, green, blue = three(colour)
    if not all(part in range(256) for part in (red, green, blue)):
        raise typer.BadParameter(f"{colour!r}: integers from 0 to 255", param_hint="R,G,B")
    with running_fleet(fleet, [vehicle]) as running:
        running[vehicle].light((int(red), int(green), int(blue)))
        typer.echo(f"{vehicle}: {colour}")


def kill(vehicles: Vehicles = None, fleet: RunningFleetOption = None) -> None:
    """Cut the motors at once, until `rcopterx reset`. Vehicles in the air fall.

    Default: the vehicles of every fleet that is up on this computer.
    """
    from rcopterx import kill as fast_kill

    raise typer.Exit(fast_kill.run(vehicles or (), fleet))


def reset(vehicles: Vehicles = None, fleet: RunningFleetOption = None) -> None:
    """Leave the killed state; the vehicles are disarmed afterwards."""
    with running_fleet(fleet, vehicles) as running:
        for name in vehicles or running.file.vehicles:
            running[name].reset()
        typer.echo("reset")
