"""Steps of manoeuvres; each waits until it is done."""

import math
from collections.abc import Callable, Mapping
from typing import Final

from rcopterx.bus.messages import LeaderLink
from rcopterx.control.identification import fit
from rcopterx.control.references.paths import FlightPath
from rcopterx.experiments.paper_sequence import Say, Wait, leader_of
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.identification.identification import IdentificationError, excited_flight
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import RefusedError, Vehicle
from rcopterx.ground_station.scripting.waiting import NotReachedError
from rcopterx.vehicles.tuples import Three

Step = Callable[[Fleet, Say, Wait], None]

SETTLED_M: Final = 0.08
REST_S: Final = 0.5


def in_order(*steps: Step) -> Step:
    """Fly steps one after the other."""

    def fly(fleet: Fleet, say: Say, wait: Wait) -> None:
        for step in steps:
            step(fleet, say, wait)

    return fly


def pause(seconds: float) -> Step:
    """Wait."""
    return lambda _fleet, _say, wait: wait(seconds)


def take_off(*names: str, height_m: float = 1.0) -> Step:
    """Take off and wait until the vehicles fly; all without names."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{', '.join(names) or 'all'}: take-off to {height_m:g} m")
        fleet.take_off(names or None, height_m)

    return fly


def land(*names: str) -> Step:
    """Land and wait for touchdown; all without names."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{', '.join(names) or 'all'}: landing")
        fleet.land(names or None)

    return fly


def go_to(position_m: Three, yaw_deg: float = 0.0, name: str | None = None) -> Step:
    """Send a vehicle, by default the leader, to a set point, wait until it is there, and rest a moment."""

    def fly(fleet: Fleet, say: Say, wait: Wait) -> None:
        who = name or leader_of(fleet)
        say(f"{who}: set point {position_m} m, yaw {yaw_deg:g} deg")
        fleet[who].go_to(position_m, math.radians(yaw_deg))
        fleet[who].wait_for_arrival(SETTLED_M)
        wait(REST_S)

    return fly


def go_together(places_m: Mapping[str, Three]) -> Step:
    """Send several vehicles to set points at once and wait until all have arrived."""

    def fly(fleet: Fleet, say: Say, wait: Wait) -> None:
        for name, position_m in places_m.items():
            say(f"{name}: set point {position_m} m")
            fleet[name].go_to(position_m)
        for name in places_m:
            fleet[name].wait_for_arrival(SETTLED_M)
        wait(REST_S)

    return fly


def fly_path(path: FlightPath, name: str | None = None) -> Step:
    """Have a vehicle, by default the leader, fly a trajectory to its end."""

    def fly(fleet: Fleet, say: Say, wait: Wait) -> None:
        who = name or leader_of(fleet)
        say(f"{who}: trajectory of {fleet[who].fly(path, wait=True)}")
        wait(REST_S)

    return fly


def follow(
    name: str,
    leader: str,
    offset_m: Three,
    frame: str = "inertial",
    transition_s: float | None = None,
    yaw_offset_deg: float = 0.0,
) -> Step:
    """Give a vehicle a leader and an offset; `formed` waits until it is there."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{name}: follows {leader} at {offset_m} m, {frame} frame")
        fleet[name].follow(leader, offset_m, math.radians(yaw_offset_deg), frame, transition_s)

    return fly


def follow_several(name: str, *links: LeaderLink) -> Step:
    """Give a vehicle several leaders with weights."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{name}: follows {', '.join(f'{link.leader} ({link.weight:g})' for link in links)}")
        fleet[name].follow(links)

    return fly


def lead(name: str) -> Step:
    """Have a vehicle stop following."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{name}: leads")
        fleet[name].lead()

    return fly


def identify(name: str, seconds: float) -> Step:
    """Excite a vehicle without leaders, fit its model, and show its parameters; nothing is written."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{name}: its sticks move for {seconds:g} s")
        recording = excited_flight(
            fleet, name, seconds, progress=lambda left_s: say(f"{name}: {left_s:.0f} s left")
        )
        found = fit.identify(recording, model_of(fleet.file, name))
        if found.problems:
            raise IdentificationError(f"{name}: {'; '.join(found.problems)}")
        for number in found.parameters:
            say(f"{name}: {number.name} {number.before:.4g} -> {number.value:.4g} {number.unit}")

    return fly


def promote(name: str) -> Step:
    """Make a vehicle the leader of its formation; all vehicles keep their places."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{name}: leads the formation; {'; '.join(fleet.promote(name))}")

    return fly


def tune(name: str, change: Callable[[Vehicle], str]) -> Step:
    """Give a vehicle another controller or other settings."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{name}: flies with {change(fleet[name])}")

    return fly


def leave(name: str) -> Step:
    """Have a vehicle leave: it lands and its agent ends."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{name}: leaves")
        fleet.leave(name)

    return fly


def join(name: str) -> Step:
    """Have a vehicle join again: its agent starts, it takes off and follows its leaders."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        say(f"{name}: joins; {fleet.join(name)}")

    return fly


def formed(tolerance_m: float = SETTLED_M) -> Step:
    """Wait until every follower is at its place."""

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        fleet.wait_for_formation(tolerance_m=tolerance_m)
        say("in formation")

    return fly


def refused(what: str, request: Callable[[Fleet], object]) -> Step:
    """Make a request that must be refused.

    Raises
    ------
    NotReachedError
        The request was accepted.
    """

    def fly(fleet: Fleet, say: Say, _wait: Wait) -> None:
        try:
            request(fleet)
        except RefusedError as error:
            say(f"{what}: refused, {error}")
            return
        raise NotReachedError(f"{what} was not refused")

    return fly
