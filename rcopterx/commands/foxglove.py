"""A running fleet in Foxglove or PlotJuggler: `foxglove`."""

from contextlib import suppress
from importlib.util import find_spec
from typing import Annotated, Final

import typer

from rcopterx.commands.fleet_option import RunningFleetOption, failure, running_fleet

PORT: Final = 8765
WAIT_S: Final = 0.1
INSTALL: Final = "pip install 'rcopterx[foxglove]'"


def foxglove(
    port: Annotated[
        int, typer.Option(metavar="PORT", min=1, max=65535, help="Port of the WebSocket server.")
    ] = PORT,
    fleet: RunningFleetOption = None,
) -> None:
    """Serve a running fleet to Foxglove or PlotJuggler on this computer until Ctrl-C."""
    if find_spec("foxglove") is None:
        raise failure(f"this needs the SDK of Foxglove: {INSTALL}")
    from rcopterx.ground_station.foxglove.live import FoxgloveServer

    with (
        running_fleet(fleet) as running,
        FoxgloveServer(running.file, running.session, port) as server,
        suppress(KeyboardInterrupt),
    ):
        typer.echo(f"{server.address}  (open it in Foxglove; Ctrl-C ends the server, the fleet flies on)")
        while True:
            server.serve(WAIT_S)
