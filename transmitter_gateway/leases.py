"""Control leases: numbers that distinguish the agents of one vehicle.

An agent requests a lease and adds its number to every command. Numbers only grow and are issued here only, so
no clock of any host matters. The newest lease that has commanded counts; commands of earlier ones are
rejected from then on, however long they were delayed.
"""

import math
from typing import Final

RESERVED_S: Final = 0.1  # for an agent that was given a lease to command before the next one gets one
MOST_AGENTS: Final = 16  # agents whose leases are remembered


class Leases:
    """Leases of one vehicle: newest `issued`, and `commanding`, whose commands count; 0 for none."""

    def __init__(self) -> None:
        self.commanding = 0
        self.issued = 0
        self._of_agents: dict[int, int] = {}
        self._reserved_until_s = -math.inf

    def bid(self, agent: int, now_s: float, *, fresh: bool, take_over: bool) -> int:
        """Lease of an agent that requests one; 0 while another commands. Repeated requests get the same.

        `fresh`: the vehicle is commanded now; `take_over`: from the agent that commands.
        """
        known = self._of_agents.get(agent, 0)
        if known and known >= self.commanding:
            return known
        if not take_over and (fresh or now_s < self._reserved_until_s):
            return 0
        self.issued += 1
        self._of_agents.pop(agent, None)
        self._of_agents[agent] = self.issued
        if len(self._of_agents) > MOST_AGENTS:
            del self._of_agents[next(iter(self._of_agents))]
        self._reserved_until_s = now_s + RESERVED_S
        return self.issued

    def lost(self, lease: int) -> bool:
        """Whether a later lease commands."""
        return lease < self.commanding

    def was_issued(self, lease: int) -> bool:
        """Whether this lease can have been issued."""
        return 1 <= lease <= self.issued

    def command(self, lease: int) -> bool:
        """A valid command of a lease takes effect; True if it is the first one after another lease."""
        changed = 0 < self.commanding < lease
        self.commanding = max(self.commanding, lease)
        return changed

    def resume(self, commanding: int, issued: int, now_s: float) -> None:
        """Continue from an earlier process of the gateway."""
        self.commanding = max(self.commanding, commanding)
        self.issued = max(self.issued, commanding, issued)
        if self.issued:
            self._reserved_until_s = now_s + RESERVED_S
