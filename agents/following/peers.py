"""The newest status of every other vehicle of the fleet."""

import math
from collections.abc import Callable, Mapping

from rcopterx.bus.messages import AgentStatus
from rcopterx.bus.subscription import Inbox


class PeerStatuses:
    """Newest statuses of the other vehicles; `clock` is monotonic [s]."""

    def __init__(
        self, vehicle: str, inboxes: Mapping[str, Inbox[AgentStatus]], clock: Callable[[], float]
    ) -> None:
        self._vehicle = vehicle
        self._inboxes = inboxes
        self._clock = clock

    def statuses(self, within_s: float = math.inf) -> dict[str, AgentStatus]:
        """Statuses of the vehicles that are not silent and not older than `within_s`."""
        now_s = self._clock()
        found = {}
        for name, inbox in tuple(self._inboxes.items()):
            received = None if name == self._vehicle else inbox.latest()
            if received is not None:
                limit_s = min(within_s, inbox.channel.stale_after_s)
                if now_s - received.arrived_s <= limit_s:
                    found[name] = received.message
        return found
