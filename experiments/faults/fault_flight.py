"""One row of the table of fault flights."""

from dataclasses import dataclass

from rcopterx.experiments.faults.bench import Injector
from rcopterx.experiments.faults.promise import LIMITS, Limits, Promise


@dataclass(frozen=True)
class FaultFlight:
    """A named flight in which something goes wrong.

    Attributes
    ----------
    name, title
        For the command line and for reports; the title says what is done.
    faults
        What goes wrong, one after the other; all of it until the flight is over.
    promise
        How the flight goes on.
    down
        Vehicles that come down.
    limits
        What it has to stay within; by default what is usual for its promise.
    chaos
        Whether it may happen at any time in `rcopterx fly chaos`.
    on_floor
        Everybody stands on the floor when it begins, and is then asked to take off.
    """

    name: str
    title: str
    faults: tuple[Injector, ...]
    promise: Promise = Promise.FLIES_ON
    down: tuple[str, ...] = ()
    limits: Limits | None = None
    chaos: bool = False
    on_floor: bool = False

    @property
    def allowed(self) -> Limits:
        """Its limits."""
        return self.limits or LIMITS[self.promise]

    @property
    def launched(self) -> bool:
        """Whether only a fleet that the same program has started can fly it."""
        return any(fault.launched for fault in self.faults)
