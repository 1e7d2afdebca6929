"""Finds vehicles that no agent commands any more, so that this host starts one.

What counts is what reaches the radio. In flight, as long as serial frames are heard, their commands tell
whether an agent flies the vehicle, wherever it runs. On the floor, where nothing is urgent, the host that was
to run the agent must be silent as well: an agent that was stopped is not missed. Where the transmitter
gateway is not heard nothing is known, and nothing is started. If several hosts start an agent, or the old one
comes back, leases decide.
"""

import math
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
FLOOR_SILENT_S: Final = 2.0
"""On the floor: time without a command, and without a word of the launcher that was to run the agent."""
FLOOR_TURN_S: Final = 1.5
"""How much later the next one in line starts it, so that it has heard whether the one before did."""
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


class Runner(NamedTuple):
    """The launcher that said last that it keeps the agent of a vehicle running.

    Attributes
    ----------
    host
        Its host.
    heard_s
        When it was heard last, whatever it said [monotonic s].
    """

    host: str
    heard_s: float


class OnFloor(NamedTuple):
    """What is known of a vehicle whose arbiter does not fly.

    Attributes
    ----------
    commanded_s
        When the transmitter gateway accepted a command last [monotonic s].
    runner
        Who was to run its agent.
    """

    commanded_s: float
    runner: Runner


class Runners:
    """Who was to run which agent last, by what launchers say.

    A launcher that is silent keeps its vehicles until another one says that it runs their agents; then they
    are not its own any more, also when that one lets them go.
    """

    def __init__(self) -> None:
        self._heard_s: dict[str, float] = {}
        self._hosts: dict[str, str] = {}

    def hear(self, host: str, running: Collection[str], arrived_s: float) -> None:
        """Take in what the launcher of a host said last; hearing it again changes nothing."""
        if arrived_s <= self._heard_s.get(host, -math.inf):
            return
        self._heard_s[host] = arrived_s
        self._hosts = {name: other for name, other in self._hosts.items() if other != host}
        self._hosts |= dict.fromkeys(running, host)

    def of(self, vehicle: str) -> Runner | None:
        """Who was to run the agent of a vehicle; None if nobody is known to be."""
        host = self._hosts.get(vehicle)
        return None if host is None else Runner(host, self._heard_s[host])


class FloorGuard:
    """Watches vehicles on the floor whose agents may run on this host.

    Parameters
    ----------
    host
        This host.
    turns
        By vehicle, how many hosts are before this one in line.
    """

    def __init__(self, host: str, turns: Mapping[str, int]) -> None:
        self._host = host
        self._silent_s = {name: FLOOR_SILENT_S + FLOOR_TURN_S * turn for name, turn in turns.items()}

    def look(self, now_s: float, vehicles: Mapping[str, OnFloor]) -> list[str]:
        """Vehicles whose agent is to be started here now.

        Parameters
        ----------
        now_s
            Now [monotonic s].
        vehicles
            Those on the floor of which enough is known.
        """
        return [
            name
            for name, known in vehicles.items()
            if name in self._silent_s
            and known.runner.host != self._host
            and now_s - max(known.commanded_s, known.runner.heard_s) > self._silent_s[name]
        ]


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
