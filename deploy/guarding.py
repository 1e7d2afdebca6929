"""Finds vehicles in flight that no agent commands any more, so that this host starts one.

What counts is what reaches the radio: as long as serial frames are heard, their commands tell whether an
agent flies the vehicle, wherever it runs. Without serial frames nothing is known, and nothing is started. If
several hosts start an agent, or the old one comes back, leases decide.
"""

from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

SILENT_S: Final = 0.35
"""Time without a command after which the host that is first in line starts an agent: longer than the launcher
of the agent's host takes to replace one that hangs."""
TURN_S: Final = 0.15
"""How much later the next one in line does."""
HEARD_S: Final = 0.1
"""Frames that are older tell nothing about the present."""
AGAIN_S: Final = 5.0
"""Until an agent is started again for a vehicle that flies without its commands."""
FLYING: Final = frozenset({"armed", "hold", "land", "descend"})


class LastFrame(NamedTuple):
    """Newest serial frame of a vehicle.

    Attributes
    ----------
    state
        Of the arbiter.
    command
        Lease and sequence of the command behind it; the sequence is 0 if the arbiter flies by itself.
    arrived_s
        When it was heard [monotonic s].
    """

    state: str
    command: tuple[int, int]
    arrived_s: float


class Guard:
    """Watches vehicles whose agents may run on this host.

    Parameters
    ----------
    turns
        By vehicle, how many hosts are before this one in line.
    """

    def __init__(self, turns: Mapping[str, int]) -> None:
        self._silent_s = {vehicle: SILENT_S + TURN_S * turn for vehicle, turn in turns.items()}
        self._commands: dict[str, tuple[int, int]] = {}
        self._commanded_s: dict[str, float] = {}

    @property
    def vehicles(self) -> Collection[str]:
        """The vehicles."""
        return self._silent_s.keys()

    def look(self, now_s: float, frames: Mapping[str, LastFrame]) -> list[str]:
        """Vehicles whose agent is to be started here now.

        Parameters
        ----------
        now_s
            Now [monotonic s].
        frames
            Newest serial frame of every vehicle that was heard of.
        """
        return [vehicle for vehicle, frame in frames.items() if self._abandoned(vehicle, frame, now_s)]

    def _abandoned(self, vehicle: str, frame: LastFrame, now_s: float) -> bool:
        if vehicle not in self._silent_s:
            return False
        known = now_s - frame.arrived_s <= HEARD_S and frame.state in FLYING
        commanded = frame.command[1] > 0 and frame.command != self._commands.get(vehicle)
        if commanded:
            self._commands[vehicle] = frame.command
        if commanded or not known or vehicle not in self._commanded_s:
            self._commanded_s[vehicle] = now_s
            return False
        if now_s - self._commanded_s[vehicle] < self._silent_s[vehicle]:
            return False
        self._commanded_s[vehicle] = now_s + AGAIN_S
        return True
