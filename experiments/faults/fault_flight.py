"""One row of the table of fault flights."""

from dataclasses import dataclass

from rcopterx.experiments.faults.bench import Injector
from rcopterx.experiments.faults.promise import LIMITS, Limits, Promise


@dataclass(frozen=True)
class FaultFlight:
    """A named flight with a fault."""

    name: str
    title: str  # what happens, for reports
    faults: tuple[Injector, ...]  # injected one after the other; all of them until the flight is over
    promise: Promise = Promise.FLIES_ON
    down: tuple[str, ...] = ()  # vehicles that come down
    limits: Limits | None = None  # None for those of the promise
    # name and title of the row of the page that shows the worst of all flights that have it
    page_row: tuple[str, str] | None = None
    chaos: bool = False  # whether it may happen at any time in `rcopterx fly chaos`
    # the vehicles stand on the floor when the fault begins, and get a command to take off then
    on_floor: bool = False

    @property
    def on_page(self) -> tuple[str, str]:
        """Name and title of its row of the page."""
        return self.page_row or (self.name, self.title)

    @property
    def allowed(self) -> Limits:
        """Limits of the flight."""
        return self.limits or LIMITS[self.promise]

    @property
    def launched(self) -> bool:
        """Whether it needs a fleet that the same program has started."""
        return any(fault.launched for fault in self.faults)
