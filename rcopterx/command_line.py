"""All commands of `rcopterx` but the fast way of `kill`, see `rcopterx.cli`."""

from collections.abc import Callable
from typing import Annotated

import typer

from rcopterx.commands import (
    bench,
    certs,
    deploy,
    doctor,
    experiment,
    export,
    flights,
    fly,
    foxglove,
    ground,
    identify,
    laboratory,
    launch,
    logs,
    margins,
    new_lab,
    radio,
    replay,
    report,
    roles,
    steer,
    trajectory,
    watch,
)

app = typer.Typer(
    name="rcopterx",
    help="Formation flight of miniature helicopters with distributed model predictive control. "
    "Lengths are metres, times seconds, angles on the command line degrees.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)

COMMANDS: dict[str, tuple[Callable[..., None], ...]] = {
    "Fly": (launch.up, launch.host, launch.demo, fly.fly),
    "Watch a running fleet": (
        watch.status, watch.check, logs.logs, watch.top, ground.ground, foxglove.foxglove,
    ),
    "Steer a running fleet": (
        steer.arm, steer.takeoff, steer.goto, steer.follow, steer.lead, steer.swap, steer.promote,
        trajectory.trajectory, steer.tune, steer.join, steer.leave, steer.move, steer.land, steer.disarm,
        steer.kill, steer.reset,
    ),
    "Flight logs": (flights.flights, replay.replay, report.report, export.export, flights.recover),
    "Prepare a laboratory": (new_lab.new_lab,),
    "Prepare hosts": (deploy.deploy, certs.certs, doctor.doctor),
    "Prepare vehicles": (identify.identify, margins.margins),
    "Prepare radios": (radio.bind, radio.range_check, radio.calibrate, radio.udev_rules),
    "Try out faults": (laboratory.inject, laboratory.replay_tracker),
    "Experiment": (experiment.experiment,),
    "Run one process": (
        roles.router, roles.recorder, roles.simulator, roles.tracker, roles.transmitters, roles.agent,
    ),
}  # fmt: skip


def _tell_version(wanted: bool) -> None:
    if not wanted:
        return
    from rcopterx.flights.provenance import provenance

    origin = provenance()
    known = f" (commit {origin['commit']})" if origin["commit"] else ""
    typer.echo(f"rcopterx {origin['rcopterx']}{known}, Python {origin['python']}")
    raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_tell_version, is_eager=True, help="Tell version and commit."),
    ] = False,
) -> None:
    pass


WITH_COORDINATES = (steer.goto,)
"""A coordinate may be negative; unknown options are not looked for, so that -0.5 is a number."""
for panel, commands in COMMANDS.items():
    for command in commands:
        settings = {"ignore_unknown_options": command in WITH_COORDINATES}
        app.command(rich_help_panel=panel, context_settings=settings)(command)
app.add_typer(bench.app, name="bench", rich_help_panel="Experiment")
