"""Detection of links between routers that carry nothing in one direction or both.

TCP notices a cut link after seconds to minutes, and Zenoh may then reopen one direction only. So routers send
beats all the time, with the newest beats that they received.
"""

import math
from collections import Counter, deque
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Final, NamedTuple, Self

from msgspec import structs

from rcopterx.bus.host_messages import Beat, Echo, LinkState

SAMPLES: Final = 125  # newest beats that are compared: those of ten seconds, in which clocks drift little


class ClockOffset(NamedTuple):
    """Another host's clock minus this one's, by one exchange; the least, with the shortest way, is the best.

    As in NTP (RFC 5905); `offset_s` is wrong by at most half of `round_trip_s`.
    """

    round_trip_s: float
    offset_s: float

    @classmethod
    def of(cls, sent_s: float, received_s: float, answered_s: float, arrived_s: float) -> Self:
        """Offset by the times of an exchange; it was received and answered by the other host's clock."""
        round_trip_s = (arrived_s - sent_s) - (answered_s - received_s)
        return cls(max(0.0, round_trip_s), ((received_s - sent_s) + (answered_s - arrived_s)) / 2)


SILENCE_S: Final = 0.32  # without a beat a direction is dead: four beats, more than a stall of 0.2 s
LONGEST_PATIENCE_S: Final = 2.0  # with a router whose beats never arrive: dialling does not help then
MOST_DOUBLINGS: Final = 8  # doublings until the patience is the longest
STALL_S: Final = 0.25  # a watch that was not called for so long cannot judge the silence of others
LATE_S: Final = 0.1
MOST_SLOWNESS: Final = 10.0  # a link that is cut returns within seconds in the slowest motion, too


class RouterLink(NamedTuple):
    """A connection to the router of another host: its identity, and the addresses of both ends."""

    router: str
    local: tuple[str, int]
    remote: tuple[str, int]


@dataclass
class _Neighbour:
    beat: Beat
    arrived_s: float
    answered_s: float  # arrival of its newest beat that contains a fresh echo of this router
    delays_s: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    """Between its clock at sending and the clock of this host at arrival, of the newest beats."""
    offsets: deque[ClockOffset] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    """Of the newest exchanges."""


class LinkWatch:
    """Judges the links of a router; `now_s` is the monotonic clock, `speed` that of the fleet's clocks."""

    def __init__(self, host: str, router: str, now_s: float, speed: float = 1.0) -> None:
        self._host, self._speed = host, speed
        self.slowness = min(MOST_SLOWNESS, max(1.0, 1.0 / speed))
        """Factor of all times in slow motion, where more processes may delay each other."""
        self._router = router
        self._judged_s = now_s
        self._neighbours: dict[str, _Neighbour] = {}
        self._opened_s: dict[RouterLink, float] = {}
        self._failures: Counter[str] = Counter()  # by router
        self._redials: Counter[str | None] = Counter()  # by host
        self._late: Counter[str] = Counter()
        self.due_s = math.inf  # when the next link that `broken` left open counts as silent

    def add_beat(self, host: str, beat: Beat, arrived_s: float) -> None:
        """Add a beat of another host; arrivals from a host do not decrease."""
        known = self._neighbours.get(host)
        if known is None or known.beat.router != beat.router:
            known = self._neighbours[host] = _Neighbour(beat, arrived_s, -math.inf)
        known.delays_s.append(arrived_s - beat.sent_s)
        self._late[host] += known.delays_s[-1] - min(known.delays_s) > LATE_S
        known.beat, known.arrived_s = beat, arrived_s
        echo = beat.echoes.get(self._host)
        if echo is not None and echo.router == self._router and echo.held_s <= self.slowness * SILENCE_S:
            known.answered_s = arrived_s
            received_s = beat.sent_s - echo.held_s
            known.offsets.append(ClockOffset.of(echo.sent_s, received_s, beat.sent_s, arrived_s))

    def beat(self, now_s: float, time_of_day_s: float) -> Beat:
        """Return the beat to send now."""
        echoes = {
            host: Echo(
                router=known.beat.router, sent_s=known.beat.sent_s, held_s=max(0.0, now_s - known.arrived_s)
            )
            for host, known in self._neighbours.items()
        }
        return Beat(router=self._router, sent_s=now_s, time_of_day_s=time_of_day_s, echoes=echoes)

    def broken(self, links: Collection[RouterLink], now_s: float) -> list[RouterLink]:
        """Return the links of `links`, all that are open now, to be closed and dialled again.

        New links have a time for their first beats, twice that after each attempt in vain.
        """
        asleep = now_s - self._judged_s > self.slowness * STALL_S
        self._judged_s = now_s
        opened_s = {link: now_s if asleep else self._opened_s.get(link, now_s) for link in links}
        broken: list[RouterLink] = []
        self.due_s = math.inf
        for link in links:
            silent_at_s = self._silent_at_s(link.router, opened_s[link])
            if now_s <= silent_at_s:
                self.due_s = min(self.due_s, silent_at_s)
                continue
            self._failures[link.router] += 1
            self._redials[self._host_of(link.router)] += 1
            broken.append(link)
            opened_s[link] = now_s
        self._opened_s = opened_s
        known = {neighbour.beat.router for neighbour in self._neighbours.values()}
        gone = self._failures.keys() - {link.router for link in links} - known
        for router in gone:
            del self._failures[router]
        return broken

    def _silent_at_s(self, router: str, opened_s: float) -> float:
        """When a link that has been open since a moment counts as silent."""
        host = self._host_of(router)
        alive_s = -math.inf if host is None else self._both_ways_s(host)
        if alive_s >= opened_s:
            self._failures.pop(router, None)
        doublings = min(self._failures[router], MOST_DOUBLINGS)
        return max(alive_s, opened_s) + self.slowness * min(LONGEST_PATIENCE_S, SILENCE_S * 2.0**doublings)

    def states(self, hosts: Collection[str], now_s: float, time_of_day_s: float) -> dict[str, LinkState]:
        """Return the state of the links to these hosts."""
        return {host: self._state(host, now_s, time_of_day_s) for host in hosts}

    def _state(self, host: str, now_s: float, time_of_day_s: float) -> LinkState:
        known = self._neighbours.get(host)
        clock = None if known is None else min(known.offsets, default=None)
        state = LinkState(
            linked=known is not None and now_s - self._both_ways_s(host) <= self.slowness * SILENCE_S,
            redials=self._redials[host],
            late=self._late[host],
        )
        if known is None or clock is None:
            return state
        theirs_s = known.beat.time_of_day_s - known.beat.sent_s + clock.offset_s
        return structs.replace(
            state,
            round_trip_s=clock.round_trip_s,
            clock_offset_s=theirs_s - (time_of_day_s - now_s),
            monotonic_offset_s=self._speed * clock.offset_s,
        )

    def _both_ways_s(self, host: str) -> float:
        known = self._neighbours[host]
        return min(known.arrived_s, known.answered_s)

    def _host_of(self, router: str) -> str | None:
        return next((host for host, known in self._neighbours.items() if known.beat.router == router), None)
