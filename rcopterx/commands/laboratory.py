"""The motion capture of a laboratory that is not there: replaying a recorded Tracker."""

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn

from deploy.fleet import FleetError
from rcopterx.fleet_option import user_errors
from simulator.tracker_replay import ReplayProgress, TrackerReplay
from vicon_gateway.recording import RecordedConnection, RecordingError, connections, read_records

POLL_S = 0.1


def replay_tracker(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", exists=True, dir_okay=False, readable=True, help="Raw recording of a stream."
        ),
    ],
    port: Annotated[
        int, typer.Option(metavar="PORT", min=0, max=65535, help="TCP port to listen on; 0 takes a free one.")
    ] = 18801,
    address: Annotated[str, typer.Option(metavar="ADDRESS", help="Address to listen on.")] = "127.0.0.1",
    speed: Annotated[float, typer.Option(metavar="FACTOR", help="1 is real time, 2 twice as fast.")] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end, until Ctrl-C.")] = False,
) -> None:
    """Play a recording of a Tracker to the Vicon gateway that connects: the same bytes at the same times.

    Each client that connects gets the next recorded connection. Ends after the last one.
    """
    with user_errors(), _replay(file, address, port, speed) as replay, suppress(KeyboardInterrupt):
        host, bound = replay.address
        typer.echo(f"{file}: {_contents(replay.progress)}; connect to {host}:{bound}", err=True)
        _play(replay, loop)


def _replay(file: Path, address: str, port: int, speed: float) -> TrackerReplay:
    try:
        return TrackerReplay(_recorded(file), address, port, speed=speed)
    except ValueError as error:
        raise FleetError(f"{file}: {error}") from None


def _recorded(file: Path) -> list[RecordedConnection]:
    with file.open("rb") as source:
        found = connections(read_records(source))
    if not found:
        raise RecordingError("the recording holds no connection")
    return found


def _contents(progress: ReplayProgress) -> str:
    return f"{progress.connections} connection{'s' if progress.connections > 1 else ''}"


def _play(replay: TrackerReplay, loop: bool) -> None:
    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[time]}")
    with Progress(*columns) as bar:
        task = bar.add_task("", total=1.0, time="")
        while loop or not replay.finished:
            replay.poll(POLL_S)
            now = replay.progress
            bar.update(
                task,
                description=f"connection {now.connection} of {now.connections}"
                if now.connection
                else "nobody has connected yet",
                completed=now.played_s,
                total=now.total_s or 1.0,
                time=f"{now.played_s:.1f} of {now.total_s:.1f} s",
            )
