"""The router process of a host. No Python code runs per message, except for its own probe."""

import os
import signal
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Final

import zenoh
from zenoh.handlers import Callback

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.endpoints import Protection, open_session, reason_of, router_config
from rcopterx.bus.links import LinkService
from rcopterx.bus.probe import probe_until
from rcopterx.bus.realtime import request_realtime
from rcopterx.bus.requests import IdentifyReply

REFUSALS: Final = "off,zenoh_link_tls=warn,zenoh::net::routing::interceptor::access_control=info"
"""Zenoh's log of refused connections and certificates."""


def run_router(
    listen: list[str],
    connect: list[str],
    namespace: str | None,
    realtime_priority: int,
    identity: IdentifyReply | None = None,
    others: Sequence[str] = (),
    protection: Protection | None = None,
) -> None:
    """Route until SIGTERM or SIGINT; the heartbeat continues as long as messages pass through the router.

    Parameters
    ----------
    listen, connect, namespace, protection
        See `rcopterx.bus.endpoints.router_config`; with protection Zenoh logs refusals on standard output.
    realtime_priority
        SCHED_FIFO priority, 0 for none.
    identity
        Answer to the request `identify`; None for a router without identity and heartbeat.
    others
        Other hosts of the fleet, whose routers are linked to this one.

    Raises
    ------
    OSError
        A listen endpoint cannot be opened.
    """
    # A byte in a pipe also ends a wait that begins a moment after the signal.
    ended, end = os.pipe()
    os.set_blocking(end, False)
    signal.set_wakeup_fd(end)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: None)
    request_realtime(realtime_priority)
    if protection is not None:
        zenoh.init_log_from_env_or(REFUSALS)
    try:
        session = open_session(router_config(listen, connect, namespace, protection))
    except zenoh.ZError as error:
        raise OSError(f"router cannot listen on {', '.join(listen)}: {reason_of(error)}") from None
    credentials = None if protection is None else protection.credentials
    with ExitStack() as stack:
        stack.callback(session.close)
        if identity is not None:
            _identify(session, identity)
            fleet, host = identity.fleet, identity.host
            links = LinkService(session, fleet, host, others) if others else None
            if links is not None:
                stack.callback(links.close)
            probe_until(ended, listen[0], namespace, fleet, host, credentials)
        else:
            os.read(ended, 1)


def _identify(session: zenoh.Session, identity: IdentifyReply) -> None:
    payload = encode(identity)

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, payload)

    key = channels.request_key(identity.fleet, identity.host, "identify")
    session.declare_queryable(key, Callback(answer, indirect=False), complete=True)
