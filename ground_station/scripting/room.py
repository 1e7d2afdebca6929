"""The room of a running fleet, whose keep-out zones change in flight."""

from dataclasses import replace
from typing import Final

import numpy as np

from rcopterx.bus.message import Four
from rcopterx.control.references.paths import FlightPath
from rcopterx.fleet.formation_check import links_of, room_of
from rcopterx.formation.homing import ways_to
from rcopterx.formation.placement import Room, take_off_problem
from rcopterx.formation.topology import followers, formation_of, places
from rcopterx.ground_station.scripting.observer import Observer

ROUND_M: Final = 0.02  # how much farther ways round zones keep from them than the margins ask


def present_room(fleet: Observer, name: str | None = None) -> Room:
    """Return what a vehicle, by default the first one, has to stay within and out of now."""
    return replace(room_of(fleet.file, name), zones=fleet.zones.zones)


def way_round(fleet: Observer, name: str, aim: Four) -> FlightPath | None:
    """Return a way of a vehicle and its followers round zones that bar the straight one, to x y z yaw.

    None if no zone does, or there is no way. Other vehicles have to be avoided only where they are now.
    """
    fleet.wait_for_status()  # of all vehicles: of followers, too, and of others in the way
    statuses = fleet.statuses()
    if name not in statuses or (here_m := statuses[name].position_m) is None:
        return None
    links, heads = formation_of(statuses)
    where, along = places(links, heads), followers(links, name)
    moved_m = [where[other] for other in (name, *along) if other in where]
    room = present_room(fleet, name).shrunk(ROUND_M, [*moved_m, np.array(here_m)])
    room = room.with_beside((at_m - where[name])[:3] for at_m in moved_m[1:])
    present, end = np.array([*here_m, statuses[name].set_point.yaw_rad]), np.array(aim)
    if room.barred(np.array([present, end])) is None or room.outside(end) is not None:
        return None
    others_m = [place[:3] for other, place in where.items() if other not in (name, *along)]
    half_axes_m = fleet.file.avoidance.horizontal_m, fleet.file.avoidance.vertical_m
    return ways_to({name: end}, {name: present}, others_m, room, half_axes_m).get(name)


def join_problem(fleet: Observer, name: str, height_m: float) -> str | None:
    """Vehicle or zone in the way of a take-off, as its agent would find; None while its place is unknown."""
    state = fleet.moving_state_of(name, lambda state: state.seen_at_m is not None)
    if state.seen_at_m is None or state.airborne:
        return None
    following, room = links_of(fleet.file)[name], present_room(fleet, name)
    return take_off_problem(name, np.array(state.seen_at_m), height_m, following, fleet.statuses(), room)
