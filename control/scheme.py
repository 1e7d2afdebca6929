"""What a scheme is: a controller that exchanges messages with those of other vehicles.

Write a class with the methods of `Scheme`, register it under the entry-point group `rcopterx.schemes`, and
the arena compares it with all others. A controller that needs only the plans of its leaders (leader-follower
control) is no scheme; it takes part as it is.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple, Protocol, runtime_checkable

from msgspec import Struct

from rcopterx.control.interfaces import Controller, Estimate
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.state import Array

MAX_MESSAGE_BYTES: Final = 4096


class Neighbour(NamedTuple):
    """Another vehicle, as far as a scheme is concerned with it."""

    message: Struct | None
    """Its newest message, of the scheme's own type; None before the first."""
    age_s: float
    """Time since that message was sent; infinite before the first."""
    offset_m: Array | None
    """Where this vehicle should be relative to it, inertial frame, shape (3,); None without such a wish."""
    followed: bool
    """Whether it is a leader of this vehicle, not a follower."""


class Situation(NamedTuple):
    """What an exchange starts from."""

    vehicle: str
    """Name of this vehicle."""
    time_s: float
    """Time of the fleet's clock, the same for all vehicles."""
    estimate: Estimate
    """State at the instant at which the input of this control period begins to act."""
    reference: Trajectory
    """N stages from that instant on; the place held by a vehicle that follows."""
    neighbours: Mapping[str, Neighbour]
    """Vehicles with messages or offsets, by name."""

    @property
    def follows(self) -> bool:
        """Whether the vehicle follows others, so that the reference is not its task."""
        return any(neighbour.followed for neighbour in self.neighbours.values())


@runtime_checkable
class Scheme(Controller, Protocol):
    """A controller with messages: `exchange` receives and sends them, `step` computes the command."""

    Message: type[Struct]
    """Type of the messages, with plain fields."""

    @property
    def exchanges(self) -> int:
        """Number of exchanges in a control period, evenly spread; the first one comes before `step`."""

    def exchange(self, situation: Situation) -> Struct | None:
        """Use the newest messages of the neighbours; return the own message, None for none.

        Messages are broadcast. They may be lost and late, and a vehicle may fall silent.
        """
