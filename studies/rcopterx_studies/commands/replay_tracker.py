"""Replaying a recorded Tracker: `replay-tracker`."""

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from rcopterx.bus.realtime import request_realtime
from rcopterx.commands.interruption import until_ctrl_c
from rcopterx.commands.output import Progress

if TYPE_CHECKING:
    from rcopterx_studies.replay.tracker_replay import TrackerReplay

POLL_S = 0.1
LOOPBACK = "127.0.0.1"
REALTIME_PRIORITY = 20  # where the operating system permits it, so that bytes are not late

app = typer.Typer(add_completion=False)


@app.command(rich_help_panel="Try out faults")
def replay_tracker(
    file: Annotated[
        Path,
        Argument(
            metavar="FILE", exists=True, dir_okay=False, readable=True, help="Raw recording of a stream."
        ),
    ],
    port: Annotated[
        int, Option(metavar="PORT", min=0, max=65535, help="TCP port to listen on; 0 takes a free one.")
    ] = 18801,
    speed: Annotated[float, Option(metavar="FACTOR", help="2 is twice as fast as real time.")] = 1.0,
    loop: Annotated[bool, Option("--loop", help="Repeat until Ctrl-C.")] = False,
) -> None:
    """Replay a recording of a Tracker to a Vicon gateway: the same bytes at the same times.

    Each client that connects gets the next recorded connection. Ends after the last one.
    """
    with closing(_replay(file, port, speed)) as replay, until_ctrl_c() as interrupts:
        request_realtime(REALTIME_PRIORITY)
        host, bound = replay.address
        count = replay.progress.connections
        connections = f"{count} connection{'s' if count > 1 else ''}"
        typer.echo(f"{file}: {connections}; connect to {host}:{bound}", err=True)
        progress = Progress(str(file))
        while (loop or not replay.finished) and not interrupts.is_set():
            replay.poll(POLL_S)
            now = replay.progress
            label = (
                f"connection {now.connection} of {now.connections}" if now.connection else "no connection yet"
            )
            progress.show(label, f", {now.played_s:.1f} of {now.total_s:.1f} s")


def _replay(file: Path, port: int, speed: float) -> "TrackerReplay":
    from rcopterx.fleet.schema import errors_at
    from rcopterx_studies.replay.raw_recording import connections
    from rcopterx_studies.replay.tracker_replay import TrackerReplay

    with errors_at(file, ValueError):
        with file.open("rb") as source:
            recorded = connections(source)
        return TrackerReplay(recorded, LOOPBACK, port, speed=speed)
