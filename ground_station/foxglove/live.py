"""Serves a running fleet to Foxglove and PlotJuggler over their WebSocket protocol."""

import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Final

import foxglove

from rcopterx.bus.session import RawMessage, Session
from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.foxglove.view import FoxgloveView

HOST: Final = "127.0.0.1"
NANO: Final = 1_000_000_000


class FoxgloveServer:
    """A server for viewers on this computer; it only reads from the bus.

    The SDK cannot check who connects: every program of this computer, and every web page in its browsers, can
    read. It has no capability by which viewers could send anything.

    Port 0 takes any free port. `wall_ns` and `clock` are the wall clock [ns] and the monotonic clock [s].
    Raises OSError if the port is in use.
    """

    def __init__(
        self,
        fleet: FleetFile,
        session: Session,
        port: int,
        wall_ns: Callable[[], int] = time.time_ns,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        context = foxglove.Context()
        self._view = FoxgloveView(fleet, context)
        self._arrived: SimpleQueue[RawMessage] = SimpleQueue()
        self._zero_ns = wall_ns() - round(clock() * NANO)
        try:
            self._server = foxglove.start_server(
                name=fleet.name, host=HOST, port=port, capabilities=[], context=context
            )
        except RuntimeError as error:
            raise OSError(f"port {port}: {error}") from None
        session.tap(self._arrived.put)

    @property
    def address(self) -> str:
        """Address for viewers."""
        return f"ws://{HOST}:{self._server.port}"

    def serve(self, wait_s: float) -> None:
        """Show the messages that arrive within a time, at least those that are waiting."""
        try:
            arrived = self._arrived.get(timeout=wait_s)
            while True:
                time_ns = self._zero_ns + round(arrived.arrived_s * NANO)
                self._view.take(arrived.unit, arrived.topic, arrived.payload, time_ns)
                arrived = self._arrived.get_nowait()
        except Empty:
            return

    def __enter__(self) -> "FoxgloveServer":
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self._server.stop()
