"""What browsers request of the fleet: names of methods, arguments of their types. Every answer is shown."""

import math
import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache, partial
from itertools import accumulate, pairwise
from typing import Annotated, Any, Final, Literal, get_type_hints

import msgspec
from msgspec import Meta, Struct

from rcopterx.bus.message import Colour, Name, Place, Setting
from rcopterx.bus.messages import LeaderLink, Zone
from rcopterx.formation.shapes import ShapeName
from rcopterx.ground_station.page.guard import RequestRejectedError
from rcopterx.ground_station.page.view import link_to
from rcopterx.ground_station.page.weights import GROUPS, Weights
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS, Vehicle

KILL_REASON: Final = "ground station"
SPEED_M_S: Final = 0.4  # along drawn waypoints
PACE_S: Final = 1.0  # least time between two waypoints

Notice = Callable[[str, bool], None]  # shows a text, and whether it is a refusal
Group = Literal["position", "velocity", "heading", "sticks"]
Power = Annotated[float, Meta(ge=-3, le=3)]
Spacing = Annotated[float, Meta(ge=0.1, le=10)]


class PageSteering:
    """Requests of the page's users, one of a kind at a time; `notice` is called with every answer."""

    def __init__(self, fleet: Fleet, notice: Notice) -> None:
        self._fleet = fleet
        self._notice = notice
        self._busy: set[str] = set()
        self._lock = threading.Lock()
        self.weights = {name: Weights(fleet, name, self.tune) for name in fleet.file.vehicles}

    def run(self, what: str, request: Callable[[], object], done: str | None = None) -> bool:
        """Run a request and show its outcome; return its success; refuse it beside one of its name `what`."""
        with self._lock:
            busy = what in self._busy
            self._busy.add(what)
        if busy:
            self.refuse(f"{what}: still under way")
            return False
        try:
            answer = request()
        except (*FLIGHT_ERRORS, ValueError) as error:
            self.refuse(str(error))
            return False
        finally:
            with self._lock:
                self._busy.discard(what)
        self._notice(done or (answer if isinstance(answer, str) and answer else what), False)
        return True

    def refuse(self, reason: str) -> None:
        """Show why no request was sent."""
        self._notice(reason, True)

    def take_off(self) -> None:
        """Arm and take off with all vehicles that are ready; name the others."""
        self.run("take-off", self._take_off)

    def _take_off(self) -> str:
        remarks = "; ".join(self._fleet.take_off())
        return f"flying; on the floor: {remarks}" if remarks else "all fly"

    def land(self, name: Name | None) -> None:
        """Land one or all vehicles."""
        names = None if name is None else [name]
        self.run(f"landing of {name or 'all'}", lambda: self._fleet.land(names), "landed")

    def home(self, name: Name | None) -> None:
        """Bring one or all vehicles back to where they took off."""
        names = None if name is None else [name]
        self.run(f"way home of {name or 'all'}", lambda: self._fleet.home(names), "home")

    def suspend(self) -> None:
        """Let all vehicles come to rest on their ways."""
        self.run("suspension", self._fleet.suspend, "suspended")

    def resume(self) -> None:
        """Let all vehicles go on from where they were suspended."""
        self.run("resumption", self._fleet.resume, "going on")

    def kill(self) -> None:
        """Cut the motors of all vehicles now, in every call, also while another kill awaits confirmation."""
        try:
            self._fleet.kill(reason=KILL_REASON)
        except FLIGHT_ERRORS as error:
            self.refuse(str(error))
        else:
            self._notice("all motors are cut; reset to fly again", False)

    def reset(self) -> None:
        """Leave KILLED, for all vehicles that are killed."""
        killed = [vehicle for vehicle in self._fleet if vehicle.state.transmitter_state == "killed"]
        names = ", ".join(vehicle.name for vehicle in killed)
        done = f"reset: {names}" if killed else "no vehicle is killed"
        self.run("reset", lambda: list(map(Vehicle.reset, killed)), done)

    def go_to(self, name: Name, place_m: Place, yaw_rad: float) -> None:
        """Send a vehicle to a set point."""
        done = f"{name}: on its way to {', '.join(f'{value:.2f}' for value in place_m)} m"
        self.run(f"set point of {name}", lambda: self._fleet[name].go_to(place_m, yaw_rad), done)

    def move(self, name: Name, place_m: Place) -> None:
        """Send a leader to a place, or give a follower that place beside its leader."""
        state = self._fleet[name].state
        if state.agent is None:
            self.refuse(f"{name} does not report")
        elif not state.assigned:
            self.go_to(name, place_m, state.agent.set_point.yaw_rad)
        else:
            leader = self._fleet.state_of(state.assigned[0].leader)
            if leader.agent is None or (leader_m := leader.place_m) is None:
                self.refuse(f"the position of {leader.name} is unknown")
                return
            yaw_rad = leader.agent.yaw_rad or 0.0
            self._follow(name, (link_to(state.assigned[0], place_m, leader_m, yaw_rad),))

    def _follow(self, name: str, links: Sequence[LeaderLink]) -> None:
        vehicle = self._fleet[name]
        self.run(f"leaders of {name}", lambda: vehicle.follow(links) if links else vehicle.lead())

    def follow(self, name: Name, leader: Name | None) -> None:
        """Let a vehicle follow another one from its present place, or lead."""
        if leader is None:
            self._follow(name, ())
            return
        own, other = self._fleet.state_of(name).place_m, self._fleet.state_of(leader).place_m
        if own is None or other is None:
            self.refuse(f"the position of {name} or {leader} is unknown")
            return
        x, y, z = (round(a - b, 3) for a, b in zip(own, other, strict=True))
        self._follow(name, (LeaderLink(leader=leader, offset_m=(x, y, z)),))

    def formation(self, shape: ShapeName, leader: Name, spacing_m: Spacing, assign: bool) -> None:
        """Bring all flying vehicles into a formation behind a vehicle that leads."""
        self.run(
            f"formation {shape}", lambda: "; ".join(self._fleet.form(shape, leader, spacing_m, assign=assign))
        )

    def promote(self, name: Name) -> None:
        """Make a vehicle the leader of its formation."""
        self.run("promotion", lambda: "; ".join(self._fleet.promote(name)))

    def light(self, name: Name, colour: Colour) -> None:
        """Show a colour on the LEDs of a vehicle."""
        self.run(f"light of {name}", lambda: self._fleet[name].light(colour))

    def set_zone(self, zone: Name, low_m: Place, high_m: Place, shape: Literal["box", "cylinder"]) -> None:
        """Keep vehicles out of a box or an upright cylinder from now on."""
        made = Zone(min_m=low_m, max_m=high_m, shape=shape)
        self.run(f"zone {zone}", lambda: self._fleet.set_zone(zone, made), f"vehicles keep out of {zone}")

    def remove_zone(self, zone: Name) -> None:
        """Let vehicles fly where a zone has kept them out."""
        self.run(f"zone {zone}", lambda: self._fleet.set_zone(zone, None), f"{zone} is no zone any more")

    def tune(self, name: str, controller: str | None, settings: Mapping[str, Setting]) -> bool:
        """Change the controller of a vehicle, or settings of it."""
        vehicle = self._fleet[name]
        return self.run(f"tuning of {name}", lambda: vehicle.tune(controller, None, None, **settings))

    def use_controller(self, name: Name, controller: Name) -> None:
        """Fly with another controller."""
        self.tune(name, controller, {})

    def weigh(self, name: Name, powers: dict[Group, Power] | None) -> None:
        """Fly with the default weights times powers of 2; without powers, as before the last change."""
        weights = self.weights[name]
        if powers is None:
            weights.undo()
        else:
            weights.apply(dict.fromkeys(GROUPS, 0.0) | powers)

    def fly_through(self, name: Name, places_m: list[Place]) -> None:
        """Fly through waypoints from the present position."""
        # Numerical libraries take longer to import than the rest of the page.
        from rcopterx.control.references.path_shapes import through

        state = self._fleet[name].state
        if (place_m := state.place_m) is None or not places_m:
            self.refuse("click waypoints in the scene first")
            return
        yaw_rad = 0.0 if state.agent is None else state.agent.set_point.yaw_rad
        places = [place_m, *places_m]
        legs_s = (max(PACE_S, math.dist(a, b) / SPEED_M_S) for a, b in pairwise(places))
        rows = [(s, *p, yaw_rad) for s, p in zip(accumulate(legs_s, initial=0.0), places, strict=True)]
        self.run(f"waypoints of {name}", lambda: self._fleet[name].fly(through(rows)))


ALLOWED: Final = (
    "kill", "take_off", "home", "land", "reset", "move", "go_to", "follow", "formation", "promote",
    "use_controller", "weigh", "fly_through", "suspend", "resume", "set_zone", "remove_zone", "light",
)  # fmt: skip


class Request(Struct, frozen=True, forbid_unknown_fields=True):
    """Name of a method and its arguments."""

    do: str
    arguments: dict[str, Any] = {}


@cache
def _arguments_of(name: str) -> type[Struct]:
    hints = get_type_hints(getattr(PageSteering, name), include_extras=True)
    fields = [(field, hint) for field, hint in hints.items() if field != "return"]
    return msgspec.defstruct(name, fields, forbid_unknown_fields=True)


def decode(
    text: str, steering: PageSteering, vehicles: Collection[str], leaders: Collection[str]
) -> Callable[[], object]:
    """Return what carries out a request; raises `RequestRejectedError` where it is none of the page."""
    try:
        request = msgspec.json.decode(text, type=Request)
        if request.do not in ALLOWED:
            raise RequestRejectedError(f"no request {request.do!r}")
        arguments = msgspec.structs.asdict(msgspec.convert(request.arguments, _arguments_of(request.do)))
    except msgspec.MsgspecError as error:
        raise RequestRejectedError(f"not a request of the page: {error}") from None
    for name, known in ((arguments.get("name"), vehicles), (arguments.get("leader"), leaders)):
        if name is not None and name not in known:
            raise RequestRejectedError(f"no vehicle {name!r}")
    return partial(getattr(steering, request.do), **arguments)
