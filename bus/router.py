"""The router process of a host. No Python code runs per message, except for its own probe."""

import os
import select
import signal
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Final

import zenoh

from rcopterx.bus import channels
from rcopterx.bus.clock import REAL_TIME, Clock
from rcopterx.bus.codec import encode
from rcopterx.bus.endpoints import Protection, client_config, open_session, reason_of, router_config
from rcopterx.bus.heartbeat import LONGEST_WAIT_S, Heartbeat, own_heartbeat
from rcopterx.bus.keys import probe_key
from rcopterx.bus.realtime import request_realtime
from rcopterx.bus.requests import IdentifyReply
from rcopterx.bus.subscription import callback_of

REFUSALS: Final = "off,zenoh_link_tls=warn,zenoh::net::routing::interceptor::access_control=info"
"""Zenoh's log of refused connections and certificates."""


def run_router(
    # see `rcopterx.bus.endpoints.router_config`; with protection Zenoh logs refusals on standard output
    listen: list[str],
    connect: list[str],
    namespace: str | None,
    realtime_priority: int,  # SCHED_FIFO priority, 0 for none
    # answer to the request `identify`; None for a router without identity and heartbeat
    identity: IdentifyReply | None = None,
    others: Sequence[str] = (),  # other hosts of the fleet, whose routers are linked to this one
    protection: Protection | None = None,
    clock: Clock = REAL_TIME,  # clock of the fleet; links between hosts are judged in real time
) -> None:
    """Route until SIGTERM or SIGINT, with a heartbeat while messages pass; `OSError` if it cannot listen."""
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
        config = router_config(listen, connect, namespace, protection, patient=clock.lockstep)
        session = open_session(config)
    except zenoh.ZError as error:
        raise OSError(f"router cannot listen on {', '.join(listen)}: {reason_of(error)}") from None
    credentials = None if protection is None else protection.credentials
    with ExitStack() as stack:
        stack.callback(session.close)
        if identity is not None:
            _identify(session, identity)
            fleet, host = identity.fleet, identity.host
            if others:
                # Imported here: fleets on one computer have no links.
                from rcopterx.bus.links import LinkService

                stack.callback(LinkService(session, fleet, host, others, speed=clock.speed).close)
            ends = client_config([listen[0]], namespace, OPENING_LIMIT_S, credentials, patient=clock.lockstep)
            probe_until(ended, ends, probe_key(fleet, host), clock.real_s(PERIOD_S), own_heartbeat())
        else:
            os.read(ended, 1)


def _identify(session: zenoh.Session, identity: IdentifyReply) -> None:
    payload = encode(identity)

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, payload)

    key = channels.request_key(identity.fleet, identity.host, "identify")
    session.declare_queryable(key, callback_of(answer, None), complete=True)


CONTENT: Final = b"probe"  # `rcopterx doctor` sends messages without content on the same key
PERIOD_S: Final = LONGEST_WAIT_S
OPENING_LIMIT_S: Final = 10.0  # longest wait until the router accepts its own process


def probe_until(ended: int, config: zenoh.Config, key: str, period_s: float, heartbeat: Heartbeat) -> None:
    """Beat as long as the router of this process routes, until the descriptor `ended` becomes readable."""
    # Two sessions: nothing is routed back to its sender.
    sender, receiver = (open_session(config) for _ in range(2))
    returned = threading.Event()
    with sender, receiver:
        receiver.declare_subscriber(key, callback_of(lambda _: returned.set(), None))
        publisher = sender.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.REAL_TIME
        )
        while not select.select([ended], [], [], period_s)[0]:
            if returned.is_set():
                returned.clear()
                heartbeat.beat()
            publisher.put(CONTENT)
        heartbeat.ending()
