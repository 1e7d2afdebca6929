"""The intent of an agent: all that a successor needs to continue its task."""

from typing import ClassVar, Final

from msgspec import Struct

from rcopterx.bus.message import (
    Clock,
    Count,
    FloatArray,
    Message,
    Name,
    Number,
    Parameters,
    Parts,
    Place,
    Seconds,
    Settings,
)
from rcopterx.bus.messages import KNOT_COLUMNS, MAX_KNOTS, LeaderLink, SetPoint, ZoneSet

MOST_ADDED: Final = 20  # knots of a way to the beginning of a requested path, and of those to rest and on


class OffsetMove(Struct, frozen=True, kw_only=True):
    """An offset to a leader that moves to its assigned value."""

    leader: Name
    start_offset_m: Place
    start_yaw_offset_rad: Number
    """At its start, in the frame of the assigned offset."""
    elapsed_s: Clock
    """Time since its start."""
    duration_s: Seconds


class FlownBy(Struct, frozen=True, kw_only=True):
    """Controller, estimator and model of a vehicle."""

    controller: Name
    controller_settings: Settings = {}
    """Settings that the fleet file or a request changed; all others have their defaults."""
    estimator: Name
    estimator_settings: Settings = {}
    model: Parameters = {}
    """Parameters of the model that a request changed."""
    learned: Parts = ()
    """Parts of the model that were learned in ordinary flight."""


class Intent(Message, frozen=True, kw_only=True):
    """Task and configuration of an agent at one moment, for its successor after a restart."""

    MAX_BYTES: ClassVar[int] = 131072

    phase: Name
    epoch: Count
    frame: Count
    """Epoch and frame of that moment; elapsed times count up to it."""
    yaw_rad: Number | None = None
    """Heading at that moment with all its turns, which a motion capture does not count."""
    set_point: SetPoint
    """Held without a path, and while no plan of a leader arrives."""
    path: FloatArray | None = None
    """Path of a vehicle without leaders, shape (n, 13) as in the request `fly`."""
    path_elapsed_s: Clock = 0.0
    """Time since the start of the path."""
    floor_m: Number = 0.0
    """Height of the floor below the vehicle at take-off."""
    assigned: tuple[LeaderLink, ...] = ()
    """Leaders with their final offsets."""
    following: tuple[Name, ...] = ()
    """Leaders at present; they differ from the assigned ones while those are lost."""
    joined: tuple[Name, ...] = ()
    """Leaders whose offsets have started to move from the vehicle's own place."""
    moves: tuple[OffsetMove, ...] = ()
    """Offsets that are moving."""
    flown_by: FlownBy
    interrupted: Name | None = None
    """Phase that continues once the transmitter gateway obeys again; only in the phase `emergency`."""
    previous: FlownBy | None = None
    """`flown_by` before the last change, for a return if the change ends the process."""
    lease: Count = 0
    """Control lease of the agent."""
    path_requested: bool = True
    """Whether the path is that of a request `fly`; false for a way to the set point."""
    rest: FloatArray | None = None
    """What is left of the path that was suspended, of which `path` is the way to rest."""
    home_m: tuple[Number, Number] | None = None
    """Where the vehicle stood when it took off last, on the floor at `floor_m`: x and y; absent before."""
    zones: ZoneSet | None = None
    """As in `AgentStatus`."""

    def check(self) -> None:
        """See `Message.check`."""
        for name, path in (("path", self.path), ("rest", self.rest)):
            if path is not None:
                path.check(name, KNOT_COLUMNS, MAX_KNOTS + MOST_ADDED, 2)
