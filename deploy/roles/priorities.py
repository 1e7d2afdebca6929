"""Real-time priorities of the processes of a fleet."""

from enum import IntEnum

from rcopterx.fleet.schema import FleetFile


class Priority(IntEnum):
    """Priority relative to the fleet's real-time priority.

    Processes that others wait for come first: before all the supervisor, which kills one that spins, and the
    simulator, which stands for hardware that is never late. No process waits for the recorder.
    """

    SUPERVISOR = 8
    SIMULATOR = 7
    ROUTER = 6
    GATEWAY = 4
    LEADER = 2
    FOLLOWER = 1
    RECORDER = -1

    def of(self, fleet: FleetFile) -> int:
        """Return the SCHED_FIFO priority; 0 if the fleet file asks for none."""
        base = fleet.bus.realtime_priority
        return max(1, base + self) if base else 0
