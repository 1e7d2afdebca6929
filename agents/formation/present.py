"""The formation by the vehicles' statuses: present links, and the places of those that lead."""

from collections.abc import Iterable, Mapping

import numpy as np

from rcopterx.agents.formation.topology import FormationGraph
from rcopterx.agents.phases import Phase
from rcopterx.bus.messages import AgentStatus, LeaderLink
from rcopterx.vehicles.state import Array

AT_WORK = (Phase.TAKEOFF, Phase.FLYING)
"""Phases in which a vehicle is at its place in the formation, or on the way to it."""


def formation_of(
    statuses: Mapping[str, AgentStatus], flying: Iterable[str] = ()
) -> tuple[FormationGraph, dict[str, Array]]:
    """Return links and heads of the vehicles at work, as arguments of `topology.places`.

    A vehicle on the floor or on its way there keeps its place, and so does one whose leaders are not at work.
    `flying` names further vehicles at work.
    """
    at_work = {name for name, status in statuses.items() if status.phase in AT_WORK} | set(flying)
    links: dict[str, tuple[LeaderLink, ...]] = {}
    heads: dict[str, Array] = {}
    for name, status in statuses.items():
        led = status.assigned if status.following_mode == "follow" else status.following
        led = led if name in at_work else ()
        links[name] = led if all(link.leader in at_work for link in led) else ()
        if links[name]:
            continue
        place = status.set_point.position_m if name in at_work else status.position_m
        yaw_rad = status.set_point.yaw_rad if name in at_work else status.yaw_rad
        if place is not None:
            heads[name] = np.array([*place, yaw_rad or 0.0])
    return links, heads
