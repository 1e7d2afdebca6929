"""A change of leaders that several vehicles make at one frame: all prepare it before the first commits it."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

from rcopterx.agents.flight.fleet_clock import FleetClock
from rcopterx.bus.requests import CommitLeaders, PrepareLeaders

PREPARED_S = 3.0  # time for which a prepared change waits for its frame


@dataclass(frozen=True)
class Change:
    """New leaders of one vehicle, or its place if it leads."""

    request: PrepareLeaders
    expires_s: float  # when it is discarded [monotonic s]
    epoch: int | None = None
    frame: int = 0  # when it begins, once that is known


class Regrouping:
    """The change that one vehicle has prepared, at most one at a time."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.events: Counter[str] = Counter()
        self._clock = clock
        self._change: Change | None = None

    @property
    def leaders(self) -> set[str]:
        """Leaders of the prepared change."""
        change = self._present()
        return set() if change is None else {link.leader for link in change.request.following}

    def _present(self) -> Change | None:
        if self._change is not None and self._clock() > self._change.expires_s:
            self.events["regrouping_expired"] += 1
            self._change = None
        return self._change

    def busy(self, operation: str) -> str | None:
        """Return why no change can be prepared; None if one can."""
        change = self._present()
        if change is None or change.request.operation == operation:
            return None
        return f"another change of leaders is under way ({change.request.operation})"

    def prepare(self, request: PrepareLeaders) -> None:
        """Prepare a change; it replaces one of the same name."""
        self._change = Change(request, self._clock() + PREPARED_S)

    def commit(self, request: CommitLeaders, clock: FleetClock) -> str | None:
        """Set the frame of a change; return the reason of a refusal, or None."""
        change = self._present()
        if change is None or change.request.operation != request.operation:
            return f"nothing is prepared under {request.operation!r}"
        if request.epoch != clock.epoch:
            return f"the stream of frames is another one now: epoch {clock.epoch}, not {request.epoch}"
        if request.frame <= clock.current_frame:
            return f"frame {request.frame} has passed, the present one is {clock.current_frame}"
        self._change = replace(change, epoch=request.epoch, frame=request.frame)
        return None

    def withdraw(self, operation: str) -> None:
        """Discard a change."""
        if self._change is not None and self._change.request.operation == operation:
            self._change = None

    def due(self, clock: FleetClock) -> PrepareLeaders | None:
        """Return the request whose frame has come, once; else None."""
        change = self._present()
        if change is None or change.epoch != clock.epoch or clock.current_frame < change.frame:
            return None
        self._change = None
        return change.request
