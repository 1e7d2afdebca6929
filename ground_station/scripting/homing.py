"""Brings vehicles home: they hold, fly back on ways that keep clear of each other, and land."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from typing import Final

import numpy as np

from rcopterx.bus.session import RequestFailedError
from rcopterx.control.references.paths import FlightPath
from rcopterx.formation.homing import LONGEST_S, above, free_places, ways_to
from rcopterx.formation.topology import followers, formation_of
from rcopterx.ground_station.scripting.observer import Observer
from rcopterx.ground_station.scripting.room import present_room
from rcopterx.ground_station.scripting.state import arrival_problem
from rcopterx.ground_station.scripting.vehicle import RefusedError, Vehicle
from rcopterx.ground_station.scripting.waiting import NotReachedError, StoppedError
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import Array

FREE_FLIGHT_S: Final = 10.0  # for take-offs to end, and for transmitter gateways to return vehicles
SETTLING_S: Final = 2.5  # for vehicles to come to rest at their set points, at which their ways begin
ARRIVED_M: Final = 0.1
ARRIVAL_S: Final = 5.0  # after the last way has ended
INSIDE_M: Final = 0.1  # distance from the borders of the flight volume and of zones
SENDING_S: Final = 0.1  # for a request to one vehicle: all ways begin at the same moment
SHORTEST_WAIT_S: Final = 0.01
TIMING_M: Final = 0.05  # that vehicles keep in addition, since they begin and fly their ways not quite alike


def fly_home(
    fleet: Observer, vehicles: Mapping[str, Vehicle], names: Sequence[str], land: Callable[[list[str]], None]
) -> None:
    """Bring vehicles back to where they took off, and `land` them; see `Fleet.home`."""
    fleet.watch_motion()  # Vehicles without an agent are seen by the motion capture only.
    flying = _holding(fleet, vehicles, names)
    if flying:
        fleet.wait(SETTLING_S)
        _begin(fleet, vehicles, _ways(fleet, flying))
    try:
        fleet.wait_for_arrival(flying, ARRIVED_M, LONGEST_S + ARRIVAL_S)
    except StoppedError:
        raise
    except NotReachedError:
        astray = [name for name in flying if arrival_problem(fleet.state_of(name), ARRIVED_M)]
        land([name for name in names if name not in astray])
        raise
    land([*names])


def _holding(fleet: Observer, vehicles: Mapping[str, Vehicle], names: Sequence[str]) -> list[str]:
    """Let the vehicles that fly, and all that follow them, hold; return the former."""

    def in_phase(*phases: Phase) -> list[str]:
        return [name for name, status in fleet.statuses().items() if name in names and status.phase in phases]

    with suppress(NotReachedError):  # A vehicle that a transmitter gateway lands comes down where it is.
        fleet.wait_until(
            lambda: not in_phase(Phase.TAKEOFF, Phase.EMERGENCY), FREE_FLIGHT_S, "no free flight"
        )
    flying = in_phase(Phase.FLYING)
    links, _ = formation_of(fleet.statuses())
    for name in dict.fromkeys(chain(flying, *(followers(links, name) for name in flying))):
        vehicles[name].lead()
    return flying


def _ways(fleet: Observer, flying: Sequence[str]) -> dict[str, FlightPath]:
    """Return ways from the set points of vehicles to their places; `RefusedError` if one has none."""
    avoidance, statuses = fleet.file.avoidance, fleet.statuses()
    if missing := [name for name in flying if name not in statuses]:
        raise RefusedError(f"{', '.join(missing)}: the agent is silent")
    begins_m = [np.array(statuses[name].set_point.position_m) for name in flying]
    room = present_room(fleet).shrunk(INSIDE_M, begins_m)
    present, homes_m = {}, {}
    for name in flying:
        status = statuses[name]
        # From outside, the run-in of a trajectory leads to its beginning.
        inside_m = np.clip(status.set_point.position_m, room.min_m, room.max_m)
        present[name] = np.append(inside_m, status.set_point.yaw_rad)
        homes_m[name] = np.array(status.home_m or (*inside_m[:2], min(fleet.file.volume.min_m[2], 0.0)))
    others_m = _others(fleet, flying)
    across_m = avoidance.horizontal_m + TIMING_M
    ends_m = free_places(homes_m, others_m, room, across_m)
    if missing := [name for name in flying if name not in ends_m]:
        raise RefusedError(f"{', '.join(missing)}: no place on the floor is free")
    ways = ways_to(above(ends_m, present, room), present, others_m, room, (across_m, avoidance.vertical_m))
    if missing := [name for name in flying if name not in ways]:
        raise RefusedError(f"{', '.join(missing)}: no way home is clear of the others")
    return ways


def _others(fleet: Observer, flying: Sequence[str]) -> list[Array]:
    """Return places of other vehicles, and the set points of those in the air."""
    states = [fleet.state_of(name) for name in fleet.file.tracked if name not in flying]
    places_m = [state.seen_at_m if state.agent is None else state.agent.position_m for state in states]
    places_m += [state.agent.set_point.position_m for state in states if state.agent and state.airborne]
    return [np.array(place_m) for place_m in places_m if place_m is not None]


def _begin(fleet: Observer, vehicles: Mapping[str, Vehicle], ways: Mapping[str, FlightPath]) -> None:
    """Send ways so that all begin at the same moment; if a vehicle refuses its way, all hold."""
    begin_s = fleet.session.clock() + SENDING_S * (len(ways) + 1)
    try:
        for name, way in ways.items():
            knots = np.vstack((way.knots[:1], way.knots))
            knots[1:, 0] += max(SHORTEST_WAIT_S, begin_s - fleet.session.clock())
            vehicles[name].fly(FlightPath(knots))
    except (RefusedError, RequestFailedError):
        for name in ways:
            with suppress(RefusedError, RequestFailedError):
                vehicles[name].lead()
        raise
