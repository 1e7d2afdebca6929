"""Steps of manoeuvres; each waits until it is done."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Concatenate, Final, ParamSpec

from msgspec import convert

from rcopterx.bus.messages import LeaderLink
from rcopterx.control.identification import fit
from rcopterx.control.references import path_shapes
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.acceptance.paper_sequence import (
    PAPER_PERIOD_S,
    Say,
    Wait,
    fly_paper_sequence,
    leader_of,
)
from rcopterx.ground_station.identification.identification import Wanted, excited_flights, swinging
from rcopterx.ground_station.identification.spacing import IdentificationError
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.ground_station.scripting.waiting import NotReachedError
from rcopterx.vehicles.tuples import Three

Step = Callable[[Fleet, Say, Wait], None]
P = ParamSpec("P")

SETTLED_M: Final = 0.08
REST_S: Final = 0.5


def step(function: Callable[Concatenate[Fleet, Say, Wait, P], None]) -> Callable[P, Step]:
    """Make a function that flies a step into one that returns the step for its further arguments."""

    def with_arguments(*arguments: P.args, **options: P.kwargs) -> Step:
        return lambda fleet, say, wait: function(fleet, say, wait, *arguments, **options)

    return with_arguments


@step
def in_order(fleet: Fleet, say: Say, wait: Wait, *steps: Step) -> None:
    """Fly steps one after the other."""
    for step in steps:
        step(fleet, say, wait)


def pause(seconds: float) -> Step:
    """Wait."""
    return lambda _fleet, _say, wait: wait(seconds)


@step
def take_off(fleet: Fleet, say: Say, _wait: Wait, *names: str, height_m: float = 1.0) -> None:
    """Take off and wait until the vehicles fly; all without names."""
    say(f"{', '.join(names) or 'all'}: take-off to {height_m:g} m")
    fleet.take_off(names or None, height_m)


@step
def land(fleet: Fleet, say: Say, _wait: Wait, *names: str) -> None:
    """Land and wait for touchdown; all without names."""
    say(f"{', '.join(names) or 'all'}: landing")
    fleet.land(names or None)


@step
def go_to(
    fleet: Fleet, say: Say, wait: Wait, position_m: Three, yaw_deg: float = 0.0, name: str | None = None
) -> None:
    """Send a vehicle, by default the leader, to a set point, wait until it is there, and rest a moment."""
    who = name or leader_of(fleet)
    say(f"{who}: set point {position_m} m, yaw {yaw_deg:g} deg")
    fleet[who].go_to(position_m, math.radians(yaw_deg))
    fleet[who].wait_for_arrival(SETTLED_M)
    wait(REST_S)


@step
def go_together(fleet: Fleet, say: Say, wait: Wait, /, **places_m: Three) -> None:
    """Send several vehicles to set points at once and wait until all have arrived."""
    for name, position_m in places_m.items():
        say(f"{name}: set point {position_m} m")
        fleet[name].go_to(position_m)
    for name in places_m:
        fleet[name].wait_for_arrival(SETTLED_M)
    wait(REST_S)


@step
def figure_eight(fleet: Fleet, say: Say, wait: Wait, *arguments: Any) -> None:
    """Have the leader fly `path_shapes.figure_eight` to its end."""
    leader, path = leader_of(fleet), path_shapes.figure_eight(*arguments)
    say(f"{leader}: trajectory of {fleet[leader].fly(path, wait=True)}")
    wait(REST_S)


@step
def paper_formation(fleet: Fleet, say: Say, wait: Wait) -> None:
    """Fly the experiment of the paper's Fig. 3: set points of the leader, then other distances, then back."""
    fly_paper_sequence(fleet, say, wait)
    followers = {name: vehicle.follow[0] for name, vehicle in fleet.file.vehicles.items() if vehicle.follow}
    for name, link in followers.items():
        x, y, z = link.offset_m
        say(f"{name}: distance to {link.leader} grows by 0.2 m along x")
        fleet[name].follow(link.leader, (x - 0.2, y, z + 0.1))
    wait(PAPER_PERIOD_S)
    for name, link in followers.items():
        say(f"{name}: distance to {link.leader} as before")
        fleet[name].follow(link.leader, link.offset_m)
    wait(PAPER_PERIOD_S)


@step
def follow(
    fleet: Fleet,
    say: Say,
    _wait: Wait,
    name: str,
    leader: str,
    offset_m: Three,
    frame: str = "inertial",
    transition_s: float | None = None,
) -> None:
    """Give a vehicle a leader and an offset; `formed` waits until it is there."""
    say(f"{name}: follows {leader} at {offset_m} m, {frame} frame")
    fleet[name].follow(leader, offset_m, frame=frame, transition_s=transition_s)


@step
def follow_several(fleet: Fleet, say: Say, _wait: Wait, name: str, leaders: Sequence[dict[str, Any]]) -> None:
    """Give a vehicle several leaders with weights, by the fields of their links."""
    links = [convert(leader, LeaderLink) for leader in leaders]
    say(f"{name}: follows {', '.join(f'{link.leader} ({link.weight:g})' for link in links)}")
    fleet[name].follow(links)


@step
def _requested(
    fleet: Fleet, say: Say, _wait: Wait, words: str, request: Callable[[Fleet, str], str | None], name: str
) -> None:
    """Request something of a vehicle, and show the words with the answer, if there is one."""
    answer = request(fleet, name)
    say(f"{name}: {words}" + (f"; {answer}" if answer else ""))


lead = partial(_requested, "leads", lambda fleet, name: fleet[name].lead())
leave = partial(_requested, "leaves", lambda fleet, name: fleet.leave(name))
join = partial(_requested, "joins", lambda fleet, name: fleet.join(name))
promote = partial(_requested, "leads the formation", lambda fleet, name: "; ".join(fleet.promote(name)))


@step
def identify(fleet: Fleet, say: Say, _wait: Wait, name: str, seconds: float) -> None:
    """Excite a vehicle without leaders, fit its model, and show its parameters; nothing is written."""
    if restless := swinging(fleet, [name]):
        raise IdentificationError(f"{name}: {restless[name]}")
    say(f"{name}: its sticks move for {seconds:g} s")
    recordings, failures = excited_flights(
        fleet, [name], Wanted(seconds), lambda left_s: say(f"{name}: {left_s:.0f} s left")
    )
    if failures:
        raise IdentificationError(f"{name}: {failures[name]}")
    found = fit.identify(recordings[name], model_of(fleet.file, name))
    if found.problems:
        raise IdentificationError(f"{name}: {'; '.join(found.problems)}")
    for number in found.parameters:
        say(f"{name}: {number.name} {number.before:.4g} -> {number.value:.4g} {number.unit}")


@step
def tune(fleet: Fleet, say: Say, _wait: Wait, /, name: str, **settings: Any) -> None:
    """Give a vehicle another controller or other settings, as `Vehicle.tune`."""
    say(f"{name}: flies with {fleet[name].tune(**settings)}")


@step
def formed(fleet: Fleet, say: Say, _wait: Wait) -> None:
    """Wait until every follower is at its place."""
    fleet.wait_for_formation(tolerance_m=SETTLED_M)
    say("in formation")


@step
def refused(
    fleet: Fleet, say: Say, _wait: Wait, /, what: str, name: str, method: str, *arguments: Any, **options: Any
) -> None:
    """Call a method of a vehicle, or of the fleet if `name` is empty, that must be refused.

    Raises `NotReachedError` if it is accepted.
    """
    try:
        getattr(fleet[name] if name else fleet, method)(*arguments, **options)
    except RefusedError as error:
        say(f"{what}: refused, {error}")
        return
    raise NotReachedError(f"{what} was not refused")
