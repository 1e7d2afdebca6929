"""The formation as a graph: ancestors, cycles, places in space, and exchanges of roles; pure functions."""

from collections.abc import Iterable, Mapping

import numpy as np

from rcopterx.bus.messages import AgentStatus, LeaderLink
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import YAW, Array, heading_matrix

FormationGraph = Mapping[str, tuple[LeaderLink, ...]]  # leaders of each vehicle; empty for one without
Places = Mapping[str, Array]  # of vehicles by name: x, y, z [m], and yaw [rad] mostly, first


class TopologyError(ValueError):
    """An impossible change of leaders."""


def leaders_of(links: FormationGraph, name: str) -> tuple[str, ...]:
    """Names of the direct leaders, in order."""
    return tuple(link.leader for link in links.get(name, ()))


def ancestors(links: FormationGraph, name: str) -> tuple[str, ...]:
    """Leaders and theirs, nearest first, each once; the vehicle itself only if there is a cycle."""
    found: dict[str, None] = {}
    level = list(leaders_of(links, name))
    while level:
        new = [leader for leader in dict.fromkeys(level) if leader not in found]
        found |= dict.fromkeys(new)
        level = [further for leader in new for further in leaders_of(links, leader)]
    return tuple(found)


def followers(links: FormationGraph, name: str) -> tuple[str, ...]:
    """Vehicles that move when a vehicle moves: its followers and theirs."""
    return tuple(other for other in links if name in ancestors(links, other))


def roots(links: FormationGraph, name: str) -> tuple[str, ...]:
    """Vehicles at the head of a vehicle's formation: itself if it has no leaders."""
    line = ancestors(links, name) or (name,)
    return tuple(leader for leader in line if not links.get(leader))


def line_between(links: FormationGraph, name: str, leader: str) -> tuple[str, ...]:
    """Shortest line from a vehicle to an ancestor, both included, or to itself (a cycle); else empty."""
    lines: list[tuple[str, ...]] = [(name,)]
    seen: set[str] = set()
    while lines:
        longer = []
        for line in lines:
            for further in leaders_of(links, line[-1]):
                if further == leader:
                    return (*line, leader)
                if further not in seen:
                    seen.add(further)
                    longer.append((*line, further))
        lines = longer
    return ()


def cycle(links: FormationGraph) -> tuple[str, ...]:
    """A line of leaders that comes back to where it began; empty if there is none."""
    for name in links:
        line = line_between(links, name, name)
        if line:
            return line
    return ()


def in_words(line: Iterable[str]) -> str:
    """`h3 follows h2 follows h1`."""
    return " follows ".join(line)


def places(links: FormationGraph, heads: Places) -> dict[str, Array]:
    """Return the places of all vehicles in the steady state, from those of `heads`, shape (4,) or (k, 4).

    Vehicles whose leaders' places are unknown are left out; several leaders give a weighted mean.
    """
    found: dict[str, Array] = {}
    if not cycle(links):
        for name in links:
            _find_place(name, links, heads, found)
    return found


def _find_place(name: str, links: FormationGraph, heads: Places, found: dict[str, Array]) -> Array | None:
    """Add the place of a vehicle, and those of its leaders, to `found`."""
    # An inner function that called itself would leave a reference cycle for a garbage collector that is off.
    if name in found:
        return found[name]
    own = links.get(name, ())
    if not own:
        place = heads.get(name)
    else:
        leading = [_find_place(link.leader, links, heads, found) for link in own]
        known = [leader for leader in leading if leader is not None]
        place = station(own, known) if len(known) == len(own) else None
    if place is not None:
        found[name] = place
    return place


def station(following: Iterable[LeaderLink], leading: Iterable[Array]) -> Array:
    """Place of a follower, shape (.., 4), from its links and the places of its leaders in the same order."""
    total, place = 0.0, np.zeros(4)
    for link, leader in zip(following, leading, strict=True):
        there = leader + np.array([0.0, 0.0, link.offset_m[2], link.yaw_offset_rad])
        x, y = link.offset_m[:2]
        c, s = (1.0, 0.0) if link.frame != "heading" else (np.cos(leader[..., YAW]), np.sin(leader[..., YAW]))
        there[..., 0] += c * x - s * y
        there[..., 1] += s * x + c * y
        place = place + link.weight * there
        total += link.weight
    return np.asarray(place / total)


def link_between(follower: Array, leader: Array, like: LeaderLink, name: str) -> LeaderLink:
    """Return a link to a leader that keeps a follower in place; frame and weight as in another link."""
    arm = follower - leader
    if like.frame == "heading":
        arm[:2] = heading_matrix(leader[YAW]).T @ arm[:2]
    x, y, z, yaw = arm.tolist()
    return LeaderLink(
        leader=name, offset_m=(x, y, z), yaw_offset_rad=yaw, frame=like.frame, weight=like.weight
    )


def exchanged(
    links: FormationGraph, where: Places, first: str, second: str
) -> dict[str, tuple[LeaderLink, ...]]:
    """Return the leaders after two vehicles have exchanged their roles, while all keep their places.

    Leaders come before their followers, so that no cycle arises if only the first of them change. Raises
    `TopologyError`: a vehicle is missing, or a place is not known.
    """
    for name in (first, second):
        if name not in links:
            raise TopologyError(f"{name} does not fly in this formation")
    if first == second:
        raise TopologyError(f"{first} cannot change roles with itself")
    roles = {first: second, second: first}
    changed = {}
    for name in links:
        old = links[roles.get(name, name)]
        if name not in roles and not any(link.leader in roles for link in old):
            continue
        new = []
        for link in old:
            leader = roles.get(link.leader, link.leader)
            for who in (name, leader):
                if who not in where:
                    raise TopologyError(f"the place of {who} is not known")
            new.append(link_between(where[name], where[leader], link, leader))
        changed[name] = tuple(new)
    after = {**links, **changed}
    return {name: changed[name] for name in sorted(changed, key=lambda name: len(ancestors(after, name)))}


AT_WORK = (Phase.TAKEOFF, Phase.FLYING)  # phases at the place in the formation, or on the way to it


def formation_of(
    statuses: Mapping[str, AgentStatus], flying: Iterable[str] = ()
) -> tuple[FormationGraph, dict[str, Array]]:
    """Return links and heads of vehicles at work and of those `flying`; others keep their places, unled."""
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
