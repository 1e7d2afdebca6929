"""What the other vehicles say of themselves: who flies, who follows whom, where they are going."""

import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from agents.flight.phases import Phase
from agents.formation.topology import Links
from bus.messages import AgentStatus, Following
from bus.subscription import Inbox
from vehicles.state import Array

AT_WORK = (Phase.TAKEOFF, Phase.FLYING)
"""Phases in which a vehicle is at its place in the formation, or on the way there."""


class Neighbours:
    """Newest statuses of the other vehicles.

    Parameters
    ----------
    vehicle
        Own name.
    inboxes
        Statuses by vehicle, filled by the bus.
    clock
        Monotonic clock [s].
    """

    def __init__(
        self, vehicle: str, inboxes: Mapping[str, Inbox[AgentStatus]], clock: Callable[[], float]
    ) -> None:
        self._vehicle = vehicle
        self._inboxes = inboxes
        self._clock = clock

    def statuses(self, within_s: float = math.inf) -> dict[str, AgentStatus]:
        """Statuses of those who are not silent, and have said something in the last so many seconds."""
        now_s = self._clock()
        found = {}
        for name, inbox in tuple(self._inboxes.items()):
            if name != self._vehicle and inbox.alive(now_s):
                received = inbox.latest()
                if received is not None and now_s - received.arrived_s <= within_s:
                    found[name] = received.message
        return found


def formation_of(
    statuses: Mapping[str, AgentStatus], flying: Iterable[str] = ()
) -> tuple[Links, dict[str, Array]]:
    """Links of vehicles at work, and the places of those that keep one of their own.

    A vehicle on the floor or on its way there keeps its place, and so does one whose leaders are not at work.

    Parameters
    ----------
    statuses
        What vehicles say of themselves.
    flying
        Others that are at work as well.

    Returns
    -------
    links, heads
        As `agents.topology.places` takes them.
    """
    at_work = {name for name, status in statuses.items() if status.phase in AT_WORK} | set(flying)
    links: dict[str, tuple[Following, ...]] = {}
    heads: dict[str, Array] = {}
    for name, status in statuses.items():
        led = status.assigned if status.stance == "follow" else status.following
        led = led if name in at_work else ()
        links[name] = led if all(link.leader in at_work for link in led) else ()
        if links[name]:
            continue
        place = status.set_point.position_m if name in at_work else status.position_m
        yaw_rad = status.set_point.yaw_rad if name in at_work else status.yaw_rad
        if place is not None:
            heads[name] = np.array([*place, yaw_rad or 0.0])
    return links, heads
