"""The router process of a host. No Python code runs per message."""

import signal
import threading

import zenoh

from bus.endpoints import reason_of, router_config
from bus.realtime import request_realtime


def run_router(listen: list[str], connect: list[str], namespace: str | None, realtime_priority: int) -> None:
    """Route until SIGTERM or SIGINT.

    Parameters
    ----------
    listen, connect, namespace
        See `bus.endpoints.router_config`.
    realtime_priority
        SCHED_FIFO priority, 0 for none.

    Raises
    ------
    OSError
        A listen endpoint cannot be opened.
    """
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    request_realtime(realtime_priority)
    try:
        session = zenoh.open(router_config(listen, connect, namespace))
    except zenoh.ZError as error:
        raise OSError(f"router cannot listen on {', '.join(listen)}: {reason_of(error)}") from None
    stop.wait()
    session.close()
