"""Options, the fleet of a command, and errors as messages; imports libraries only when they are needed.

Names, limits and help of options and arguments are data: `options.toml`.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from functools import cache
from glob import escape, glob
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from rcopterx.commands.parsing import check_known
from rcopterx.deploy.hosts.running import running_fleets
from rcopterx.tables import table_beside

if TYPE_CHECKING:
    from rcopterx.fleet.schema import FleetFile
    from rcopterx.ground_station.scripting.fleet import Fleet

DEFAULT_FLEET = "trio"
EXIT_FAILED = 1
EXIT_USAGE = 2
ROUTER_S = 3.0
_OPTIONS: Final = table_beside(__file__, "options")


def fleets_beginning(incomplete: str) -> list[str]:
    """Completion: shipped fleets and fleet files."""
    from rcopterx.fleet.reading import shipped_fleets

    files = [name for name in glob(f"{escape(incomplete)}*") if name.endswith(".toml") or Path(name).is_dir()]
    return [name for name in shipped_fleets() if name.startswith(incomplete)] + sorted(files)


def vehicles_beginning(incomplete: str) -> list[str]:
    """Completion: vehicles of the fleets that are up on this computer."""
    names = {name for running in running_fleets() for name in running.vehicles}
    return sorted(name for name in names if name.startswith(incomplete))


def shared_option(name: str) -> Any:
    """Return the option or argument that several commands share, by its name in the table `shared`."""
    return _option(_OPTIONS["shared"][name])


def _option(table: dict[str, Any]) -> Any:
    settings = dict(table)
    kind: Any = typer.Argument if settings.pop("argument", False) else typer.Option
    if completion := settings.pop("complete", None):
        settings["autocompletion"] = globals()[completion]
    return kind(*settings.pop("names", ()), **settings)


@cache
def with_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Annotate the parameters of a command with their options and arguments, and return it."""
    of_module = _OPTIONS.get(command.__module__.rpartition(".")[2], {})
    for name, table in of_module.get(command.__name__, {}).items():
        option = shared_option(table) if isinstance(table, str) else _option(table)
        command.__annotations__[name] = Annotated[command.__annotations__[name], option]
    return command


FleetArgument = Annotated[str, shared_option("fleet_argument")]
FleetOption = Annotated[str, shared_option("fleet")]
RunningFleetOption = Annotated[str | None, shared_option("running_fleet")]
SpeedOption = Annotated[float | None, shared_option("speed")]
LockstepOption = Annotated[bool, shared_option("lockstep")]
RecordOption = Annotated[bool, shared_option("record")]
ColumnsOption = Annotated[Path | None, shared_option("columns")]
HostOption = Annotated[str | None, shared_option("host")]


def chosen_host(fleet: "FleetFile", host: str | None) -> str:
    """Host on which a command runs: the only one or the named one; else `FleetError`."""
    from rcopterx.fleet import schema

    if host is None and len(fleet.hosts) == 1:
        return next(iter(fleet.hosts))
    if host is None:
        raise schema.FleetError(f"--host: this fleet has several, name one of {', '.join(fleet.hosts)}")
    schema.check_known("--host", "host", host, fleet.hosts)
    return host


def fleet_file(name: str, speed: float | None = None, lockstep: bool = False) -> "FleetFile":
    """Read a fleet file or a shipped one, to be flown at a speed or in lockstep; raises FleetError."""
    from rcopterx.fleet.reading import at_speed, fleet_path, load_fleet

    if lockstep and speed is not None:
        raise typer.BadParameter("in lockstep time has no speed", param_hint="--speed")
    return at_speed(load_fleet(fleet_path(name)), speed, lockstep)


@contextmanager
def user_errors() -> Iterator[None]:
    """Print errors that users can correct as a line on standard error, without a traceback."""
    try:
        yield
    except BrokenPipeError:
        raise
    except (ValueError, RuntimeError, OSError) as error:
        # The modules of some errors import slowly.
        from rcopterx.fleet.schema import FleetError
        from rcopterx.flights.flights import NoFlightError
        from rcopterx.flights.mcap_records import FlightLogError
        from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS, lines_of

        if not isinstance(error, (FleetError, NoFlightError, FlightLogError, OSError, *FLIGHT_ERRORS)):
            raise
        code = EXIT_USAGE if isinstance(error, (FleetError, NoFlightError)) else EXIT_FAILED
        raise failure(*lines_of(error), code=code) from None


def wanted_fleet(name: str | None) -> tuple["FleetFile", str | None]:
    """The fleet of a file, or the one that is up and the host that this computer is; raises FleetError."""
    from rcopterx.ground_station.scripting.joining import fleet_that_is_up

    return fleet_that_is_up() if name is None else (fleet_file(name), None)


@contextmanager
def running_fleet(
    name: str | None, vehicles: Iterable[str] | None = None, router_within_s: float = ROUTER_S
) -> Iterator["Fleet"]:
    """Join a running fleet, by default that of this computer, and check names."""
    from rcopterx.bus.session import BusUnreachableError
    from rcopterx.ground_station.scripting.fleet import Fleet

    file, host = wanted_fleet(name)
    try:
        fleet = Fleet(file, host, router_within_s)
    except BusUnreachableError as error:
        others = ", ".join(sorted({running.fleet for running in running_fleets()}))
        hint = f"on this computer {others} is; leave out -f to use it" if others else f"(rcopterx up {name})"
        raise BusUnreachableError(f"{error}; is the fleet up? {hint}") from None
    with closing(fleet):
        check_known(vehicles or (), fleet.file.vehicles, "vehicle", "VEHICLE")
        yield fleet


def failure(*reasons: object, code: int = EXIT_FAILED) -> typer.Exit:
    """Print errors; return the exception that ends the command."""
    for reason in reasons:
        typer.echo(f"error: {reason}", err=True)
    return typer.Exit(code)
