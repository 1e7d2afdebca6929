"""Messages of routers about the links between them."""

from typing import Annotated

from msgspec import Meta, Struct

from rcopterx.bus.message import Clock, Count, Message, Name, Seconds

RouterId = Annotated[str, Meta(pattern="^[0-9a-f]{1,32}$")]
"""Zenoh's identity of a router process; a new one after every start."""


class Echo(Struct, frozen=True, kw_only=True):
    """The newest beat from a host."""

    router: RouterId
    sent_s: Clock
    """`sent_s` of the beat, on the monotonic clock of its sender."""
    held_s: Seconds
    """Time since its arrival."""


class Beat(Message, frozen=True, kw_only=True):
    """What routers send each other all the time, with the newest beats that they received."""

    router: RouterId
    sent_s: Clock
    """Monotonic clock of its host; meaningless on other hosts."""
    time_of_day_s: Clock
    """Time of the same moment since 1970 by the clock of its host."""
    echoes: dict[Name, Echo]
    """Newest beat from each other host."""


class LinkState(Struct, frozen=True, kw_only=True):
    """The link to one other host."""

    linked: bool
    """Beats arrive in both directions."""
    redials: Count
    """How often the link was closed because a direction was silent."""
    late: Count
    """Beats that arrived more than 0.1 s later than the fastest ones: the link hung."""
    round_trip_s: Seconds | None = None
    """Shortest of the last few seconds."""
    clock_offset_s: Clock | None = None
    """Time of day of the other host minus that of this one; wrong by at most half the round trip."""
    monotonic_offset_s: Clock | None = None
    """The same of the monotonic clocks, to subtract times of two hosts."""


class RouterStatus(Message, frozen=True, kw_only=True):
    """Links of a router to those of the other hosts of the fleet file."""

    links: dict[Name, LinkState]
