"""Finds vehicles that no agent commands any more, so that this host starts one.

In flight the commands behind the serial frames show whether an agent flies the vehicle, wherever it runs. On
the floor the launcher that keeps the agent running must be silent as well, so that agents that were stopped
are not replaced. Nothing is started without news from the transmitter gateway. If several hosts start an
agent, leases decide.
"""

import math
from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

from rcopterx.bus.messages import Applied
from rcopterx.bus.subscription import Received

SILENT_S: Final = 0.35
"""Time without a command after which the first host in line starts an agent: longer than the launcher of the
agent's host takes to replace one that hangs."""
TURN_S: Final = 0.15  # how much later each further host in line does
FRESH_S: Final = 0.1  # frames that are older say nothing about the present
AGAIN_S: Final = 5.0  # until an agent is started again for a vehicle that flies without its commands
FLOOR_SILENT_S: Final = 2.0  # on the floor: without a command, and a status of the agent's launcher
FLOOR_TURN_S: Final = 1.5  # how much later each further host in line starts it than the one before
FLYING: Final = frozenset({"armed", "hold", "land", "descend"})


class OnFloor(NamedTuple):
    """What is known of a vehicle whose arbiter does not fly; times are monotonic [s]."""

    commanded_s: float  # when the transmitter gateway last accepted a command
    runner: str  # host whose launcher keeps the agent running
    reported_s: float  # when the last status of that launcher arrived


class Runners:
    """Which host was last to run which agent, by statuses of launchers; silent ones keep their vehicles."""

    def __init__(self) -> None:
        self._arrived_s: dict[str, float] = {}
        self._hosts: dict[str, str] = {}

    def update(self, host: str, running: Collection[str], arrived_s: float) -> None:
        """Apply the last status of a launcher; applying it again changes nothing."""
        if arrived_s <= self._arrived_s.get(host, -math.inf):
            return
        self._arrived_s[host] = arrived_s
        self._hosts = {name: other for name, other in self._hosts.items() if other != host}
        self._hosts |= dict.fromkeys(running, host)

    def of(self, vehicle: str) -> tuple[str, float] | None:
        """Return the host that was to run an agent, and when its last status arrived; None if unknown."""
        host = self._hosts.get(vehicle)
        return None if host is None else (host, self._arrived_s[host])


class Guard:
    """Watches vehicles whose agents may run on `host`; `turns` counts the hosts in line before it."""

    def __init__(self, host: str, turns: Mapping[str, int]) -> None:
        self._host, self._turns = host, turns
        self._commands: dict[str, tuple[int, int]] = {}  # lease and sequence of the newest one
        self._commanded_s: dict[str, float] = {}

    @property
    def vehicles(self) -> Collection[str]:
        """The vehicles that it watches."""
        return self._turns.keys()

    def find_orphans(self, now_s: float, frames: Mapping[str, Received[Applied]]) -> list[str]:
        """Return the vehicles in flight whose agent this host shall start now."""
        return [name for name in self._turns if name in frames and self._abandoned(name, frames[name], now_s)]

    def _abandoned(self, vehicle: str, frame: Received[Applied], now_s: float) -> bool:
        known = now_s - frame.arrived_s <= FRESH_S and frame.message.state in FLYING
        command = (frame.message.lease, frame.message.sequence)
        # Frames of the arbiter's own have no sequence.
        commanded = frame.message.sequence > 0 and command != self._commands.get(vehicle)
        if commanded:
            self._commands[vehicle] = command
        if commanded or not known or vehicle not in self._commanded_s:
            self._commanded_s[vehicle] = now_s
            return False
        if now_s - self._commanded_s[vehicle] < SILENT_S + TURN_S * self._turns[vehicle]:
            return False
        self._commanded_s[vehicle] = now_s + AGAIN_S
        return True

    def find_orphans_on_floor(self, now_s: float, vehicles: Mapping[str, OnFloor]) -> list[str]:
        """Return the vehicles on the floor whose agent this host shall start now."""
        return [
            name
            for name, turn in self._turns.items()
            if name in vehicles
            and vehicles[name].runner != self._host
            and now_s - max(vehicles[name].commanded_s, vehicles[name].reported_s)
            > FLOOR_SILENT_S + FLOOR_TURN_S * turn
        ]
