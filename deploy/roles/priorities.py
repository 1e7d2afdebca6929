"""Which processes of a fleet run before which others."""

from enum import IntEnum

from rcopterx.fleet.schema import FleetFile


class Priority(IntEnum):
    """How far processes run above the fleet's real-time priority.

    What others wait for comes first: messages are forwarded at once, and a leader plans before its followers.
    The supervisor comes before all of them, or a process that spins would keep it from ending that process.
    The simulator computes its helicopters' motion while nobody else needs the processor, and nobody waits for
    the recorder.
    """

    SUPERVISOR = 8
    ROUTER = 6
    GATEWAY = 4
    LEADER = 2
    FOLLOWER = 1
    SIMULATOR = 0
    RECORDER = -1

    def of(self, fleet: FleetFile) -> int:
        """SCHED_FIFO priority; 0 if the fleet wants none."""
        base = fleet.bus.realtime_priority
        return max(1, base + self) if base else 0
