"""Keeps the links of a router to those of other hosts alive: sends beats, and closes silent links."""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from typing import Final

import zenoh

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import RouterStatus
from rcopterx.bus.link_sockets import Dials, close_link, hasten
from rcopterx.bus.link_watch import LinkWatch, RouterLink
from rcopterx.bus.subscription import Subscription

BEAT_S: Final = 0.08
DIAL_CHECK_S: Final = 0.02  # pause between checks of dialling attempts while a host is missing
SHORTEST_PAUSE_S: Final = 0.005
STATUS_S: Final = 0.5
BEATS_KEPT: Final = 32
_LOG = logging.getLogger(__name__)


class LinkService:
    """Watches the links of a router in a thread, in real time; `speed` below 1 slows beats up to tenfold."""

    def __init__(
        self,
        session: zenoh.Session,
        fleet: str,
        host: str,
        others: Sequence[str],
        clock: Callable[[], float] = time.monotonic,
        speed: float = 1.0,
    ) -> None:
        self._session = session
        self._others = others
        self._clock = clock
        self._watch = LinkWatch(host, str(session.zid()), clock(), speed)
        self._dials = Dials()
        self._links: set[RouterLink] = set()
        self._published_s = self._complete_s = clock()
        self._inboxes = {
            other: Subscription(
                session,
                channels.BEAT,
                channels.key(fleet, other, channels.BEAT.topic),
                lambda inbox, payload: inbox.store(payload, clock()),
                BEATS_KEPT,
            )
            for other in others
        }
        self._beats = self._publisher(fleet, host, channels.BEAT.topic, zenoh.Priority.REAL_TIME)
        self._status = self._publisher(fleet, host, channels.ROUTER_STATUS.topic, zenoh.Priority.DATA_LOW)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="links", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop watching."""
        self._ended.set()
        self._thread.join()

    def _publisher(self, fleet: str, host: str, topic: str, priority: zenoh.Priority) -> zenoh.Publisher:
        return self._session.declare_publisher(
            channels.key(fleet, host, topic),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=priority,
        )

    def _run(self) -> None:
        pause_s = DIAL_CHECK_S
        while not self._ended.wait(pause_s):
            pause_s = self._watch.slowness * BEAT_S if self._turn() else DIAL_CHECK_S
            # Both hosts close what falls silent at once, so that neither closes what the other dialled.
            pause_s = min(pause_s, max(SHORTEST_PAUSE_S, self._watch.due_s - self._clock()))

    def _turn(self) -> bool:
        """Receive, judge, act, publish; whether every other host is linked."""
        for other, inbox in self._inboxes.items():
            for received in inbox.drain():
                self._watch.add_beat(other, received.message, received.arrived_s)
        now_s = self._clock()
        links = open_links(self._session)
        for link in links - self._links:
            hasten(link)
        self._links = links
        broken = self._watch.broken(links, now_s)
        for link in broken:
            _LOG.warning("links: %s:%d - %s:%d is closed, to be dialled again", *link.local, *link.remote)
            close_link(link)
        complete = len(links) - len(broken) >= len(self._others)
        if complete:
            self._complete_s = now_s
        else:
            self._dials.abandon_lost(now_s, now_s - self._complete_s)
        now_s, time_of_day_s = self._clock(), time.time()
        self._beats.put(encode(self._watch.beat(now_s, time_of_day_s)))
        if now_s - self._published_s >= STATUS_S:
            self._published_s = now_s
            states = self._watch.states(self._others, now_s, time_of_day_s)
            self._status.put(encode(RouterStatus(links=states)))
        return complete


def open_links(session: zenoh.Session) -> set[RouterLink]:
    """Return the open links of a router to other routers."""
    routers = {str(router) for router in session.info.routers_zid()}
    return {
        RouterLink(str(link.zid), _address(str(link.src)), _address(str(link.dst)))
        for link in session.info.links()
        if str(link.zid) in routers
    }


def _address(locator: str) -> tuple[str, int]:
    """Address and port of a locator like `tcp/192.168.0.10:7447`."""
    host, _, port = locator.partition("/")[2].partition("?")[0].rpartition(":")
    return host.strip("[]"), int(port)
