"""Starting a fleet: `up`, `host` and `demo`."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, nullcontext
from typing import TYPE_CHECKING

import typer

from rcopterx.commands.fleet_option import (
    DEFAULT_FLEET,
    FleetArgument,
    FleetOption,
    HostOption,
    LockstepOption,
    RecordOption,
    SpeedOption,
    chosen_host,
    failure,
    fleet_file,
)
from rcopterx.commands.ground import page_of
from rcopterx.commands.interruption import Interrupts, counted_interrupts
from rcopterx.compiling.cache import compile_all
from rcopterx.deploy.hosts.run_directory import run_directory

if TYPE_CHECKING:
    from rcopterx.fleet.schema import FleetFile
    from rcopterx.ground_station.scripting.fleet import Fleet

REFRESH_S = 0.2
PLAIN_REFRESH_S = 5.0


@contextmanager
def interruptible(
    file: "FleetFile",
    host: str | None,
    without: Sequence[str] = (),
    *,
    watchdog: bool = True,
    record: bool = True,
    script: str = "",
) -> Iterator[tuple["Fleet", Interrupts]]:
    """Start the processes of a host, join the fleet, in lockstep as `script`; at the end land and stop."""
    from rcopterx.ground_station.scripting.launched import processes_up

    this_host = chosen_host(file, host)
    warn_of_others(file.name)
    interrupts = counted_interrupts()
    with processes_up(file, this_host, without, watchdog=watchdog, record=record, script=script) as fleet:
        try:
            yield fleet, interrupts
        finally:
            _bring_down(fleet, interrupts)


def warn_of_others(name: str) -> None:
    """Print the fleets that are up on this computer beside the one with a name."""
    from rcopterx.deploy.hosts.running import running_fleets

    if others := sorted({running.fleet for running in running_fleets()} - {name}):
        typer.echo(
            f"warning: {', '.join(others)} is up on this computer, too; real-time processes of several "
            "fleets delay each other, and vehicles may come down",
            err=True,
        )


def _bring_down(fleet: "Fleet", interrupts: Interrupts) -> None:
    """Land all vehicles; a second Ctrl-C cuts the motors."""
    from rcopterx.ground_station.scripting.waiting import NotReachedError

    if not any(vehicle.state.airborne for vehicle in fleet):
        return
    typer.echo("landing; Ctrl-C again cuts the motors", err=True)
    before = interrupts.count

    def work() -> None:
        try:
            fleet.land()
        except (NotReachedError, RuntimeError) as error:
            if interrupts.count > before:
                return
            typer.echo(f"error: {error}; the transmitter gateways land the vehicles", err=True)

    landing = threading.Thread(target=work, daemon=True)
    landing.start()
    while landing.is_alive():
        landing.join(0.1)
        if interrupts.count > before:
            typer.echo("cutting the motors", err=True)
            try:
                fleet.kill(reason="second Ctrl-C")
            except NotReachedError as error:
                typer.echo(f"error: {error}", err=True)
            return


def show_fleet(
    fleet: "Fleet", interrupts: Interrupts, lines: deque[str], done: Callable[[], bool] = lambda: False
) -> None:
    """Show a fleet until it is done or a signal arrives, as table or lines; any thread may add to `lines`."""
    from rich.console import Console
    from rich.live import Live

    from rcopterx.ground_station.terminal.live_table import fitting, fleet_view

    console, next_s = Console(), 0.0
    live = Live(console=console, refresh_per_second=1 / REFRESH_S) if console.is_terminal else None
    with live or nullcontext():
        while not done() and not interrupts.wait(REFRESH_S):
            for waiting in (lines, () if fleet.launcher is None else fleet.launcher.events):
                while waiting:
                    console.print(waiting.popleft(), highlight=False, markup=False)
            if live is not None:
                live.update(fleet_view(fleet, fitting(console.width)))
            elif time.monotonic() >= next_s:
                next_s = time.monotonic() + PLAIN_REFRESH_S
                phases = " ".join(f"{vehicle.name}:{vehicle.state.phase}" for vehicle in fleet)
                console.print(phases, highlight=False)


def up(
    fleet: FleetArgument = DEFAULT_FLEET,
    host: HostOption = None,
    without: list[str] | None = None,
    record: RecordOption = True,
    watchdog: bool = True,
    speed: SpeedOption = None,
    lockstep: LockstepOption = False,
) -> None:
    """Start a fleet and show it. Ctrl-C lands and stops; a second Ctrl-C cuts the motors.

    If the daemons of its hosts run (rcopterx host), they start the fleet, from any computer; without --host
    the fleet then flies on if this program dies.
    """
    file = fleet_file(fleet, speed, lockstep)
    if host is None and _by_daemons(file, without or (), watchdog=watchdog, record=record):
        return
    with interruptible(file, host, without or (), watchdog=watchdog, record=record) as (running, interrupts):
        typer.echo(f"logs: {run_directory(running.file.name, running.file.bus.namespace) / 'log'}", err=True)
        show_fleet(running, interrupts, deque())


def _by_daemons(file: "FleetFile", without: Sequence[str], *, watchdog: bool, record: bool) -> bool:
    """Start a fleet through the daemons of its hosts and show it; False without daemons."""
    from rcopterx.deploy.hosts.resources import check_without
    from rcopterx.deploy.hosts.running import running_fleets
    from rcopterx.fleet.schema import FleetError
    from rcopterx.ground_station.scripting.daemons import Daemons, joined_fleet

    check_without(file, without)
    if len(file.hosts) == 1 and not any(running.fleet == file.name for running in running_fleets()):
        return False
    if (fleet := joined_fleet(file)) is None:
        if len(file.hosts) > 1:
            raise FleetError(
                "no host of the fleet answers: keep each ready with rcopterx host, "
                f"or start its part with --host, one of {', '.join(file.hosts)}"
            )
        return False
    with closing(fleet):
        if not watchdog:
            raise FleetError(
                "--no-watchdog: daemons start this fleet; set watchdog.enabled = false in its file"
            )
        if not record:
            raise FleetError("--no-record: daemons start this fleet; give the option to rcopterx host")
        interrupts = counted_interrupts()
        daemons = Daemons(fleet)
        warnings = daemons.find()
        if fleet.file.clock != file.clock:
            raise FleetError(f"--speed: {fleet.file.title} is up; its speed is that of its start")
        if not (answers := daemons.start(without)):
            return False
        for line in warnings:
            typer.echo(f"warning: {line}", err=True)
        typer.echo("; ".join(answers), err=True)
        show_fleet(fleet, interrupts, deque())
        _bring_down(fleet, interrupts)
        for line in daemons.stop():
            typer.echo(f"error: {line}", err=True)
    return True


def host(fleet: FleetArgument, this: str | None = None, record: RecordOption = True) -> None:
    """Keep a host ready: run its router, and start its other processes with the fleet (rcopterx up).

    Ends with Ctrl-C or SIGTERM; transmitter gateways then land the vehicles that fly from here.
    """
    from rcopterx.deploy.hosts.launcher import Launcher

    file = fleet_file(fleet)
    name = chosen_host(file, this)
    interrupts = counted_interrupts()
    with Launcher(file, name, record=record, idle=True) as launcher:
        typer.echo(f"host {name} of fleet {file.name} is ready; rcopterx up starts the fleet", err=True)
        while not interrupts.wait(PLAIN_REFRESH_S):
            while launcher.events:
                typer.echo(launcher.events.popleft())


def demo(
    fleet: FleetOption = DEFAULT_FLEET,
    seconds: float | None = None,
    browser: bool = True,
    record: RecordOption = True,
    speed: SpeedOption = None,
    lockstep: LockstepOption = False,
) -> None:
    """Start a fleet, take off, and fly the paper's set-point sequence until Ctrl-C."""
    from rich.console import Console

    from rcopterx.ground_station.acceptance.demonstration import Demonstration

    with ExitStack() as stack:
        file = fleet_file(fleet, speed, lockstep)
        lines: deque[str] = deque()
        if browser:
            # The page loads while the fleet starts; it would not wait as long as compiling takes.
            compile_all()
            stack.enter_context(page_of(fleet, lines.append))
        running, interrupts = stack.enter_context(interruptible(file, None, record=record))
        demonstration = Demonstration(running, interrupts, lines.append)
        thread = threading.Thread(target=demonstration.fly, args=(seconds,), daemon=True)
        thread.start()
        show_fleet(running, interrupts, lines, lambda: not thread.is_alive())
        thread.join(20.0)
    # Its figures take time, in which vehicles would fly on.
    Console().print(demonstration.summary())
    if demonstration.problem is not None:
        raise failure(demonstration.problem)
