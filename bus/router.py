"""The router process of a host. No Python code runs per message."""

import os
import signal

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
    # A signal that comes a moment before a wait for an event begins does not end it; a byte in a pipe does.
    ended, end = os.pipe()
    os.set_blocking(end, False)
    signal.set_wakeup_fd(end)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: None)
    request_realtime(realtime_priority)
    try:
        session = zenoh.open(router_config(listen, connect, namespace))
    except zenoh.ZError as error:
        raise OSError(f"router cannot listen on {', '.join(listen)}: {reason_of(error)}") from None
    os.read(ended, 1)
    session.close()
