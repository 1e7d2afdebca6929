"""What the page requests of the fleet: every answer is shown."""

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Final, Literal

from msgspec import Meta

from rcopterx.bus.message import Name, Place, Setting
from rcopterx.bus.messages import LeaderLink
from rcopterx.ground_station.geometry import link_to
from rcopterx.ground_station.page.weights import GROUPS, Weights
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS

KILL_REASON: Final = "ground station"
SPEED_M_S: Final = 0.4  # along drawn waypoints
PACE_S: Final = 1.0  # least time between two waypoints

Notice = Callable[[str, bool], None]  # shows a text, and whether it is a refusal
ShapeName = Literal["line", "column", "wedge", "ring"]
Group = Literal["position", "velocity", "heading", "sticks"]
Power = Annotated[float, Meta(ge=-3, le=3)]
Spacing = Annotated[float, Meta(ge=0.1, le=10)]


def _line(count: int, spacing_m: float) -> list[Place]:
    sides = (((index // 2) + 1) * (1 if index % 2 == 0 else -1) for index in range(count))
    return [(0.0, spacing_m * side, 0.0) for side in sides]


def _ring(count: int, spacing_m: float) -> list[Place]:
    """Leader in the middle, followers around it, neighbours and leader at least `spacing_m` apart."""
    radius_m = max(spacing_m, spacing_m / (2.0 * math.sin(math.pi / count))) if count > 1 else spacing_m
    angles = (2.0 * math.pi * index / count for index in range(count))
    return [(radius_m * math.cos(angle), radius_m * math.sin(angle), 0.0) for angle in angles]


SHAPES: Final[Mapping[ShapeName, Callable[[int, float], list[Place]]]] = {
    "line": _line,
    "column": lambda count, spacing_m: [(-spacing_m * (index + 1), 0.0, 0.0) for index in range(count)],
    "wedge": lambda count, spacing_m: [
        (-abs(y), y, 0.0) for _, y, _ in _line(count, spacing_m / math.sqrt(2.0))
    ],
    "ring": _ring,
}


def formation_links(
    shape: ShapeName, leader: str, followers: Sequence[str], spacing_m: float
) -> dict[str, LeaderLink]:
    """Links of a formation of `SHAPES`, `spacing_m` apart, in order; offsets turn with the leader."""
    places = SHAPES[shape](len(followers), spacing_m)
    return {
        name: LeaderLink(leader=leader, offset_m=place, frame="heading")
        for name, place in zip(followers, places, strict=True)
    }


class PageSteering:
    """Requests of the page's users, one of a kind at a time; `notice` is called with every answer."""

    def __init__(self, fleet: Fleet, notice: Notice) -> None:
        self._fleet = fleet
        self._notice = notice
        self._busy: set[str] = set()
        self._lock = threading.Lock()
        self.weights = {name: Weights(fleet, name, self.tune) for name in fleet.file.vehicles}

    def run(self, what: str, request: Callable[[], object], done: str | None = None) -> bool:
        """Run a request and show its outcome; return its success. Requests of one name `what` exclude."""
        with self._lock:
            if what in self._busy:
                return False
            self._busy.add(what)
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
        """Arm and take off with all vehicles that are ready."""

        def take_off() -> str:
            behind = self._fleet.take_off()
            return f"flying; on the floor: {'; '.join(behind)}" if behind else "all fly"

        self.run("take-off", take_off)

    def land(self, name: Name | None) -> None:
        """Land one or all vehicles."""
        names = None if name is None else [name]
        self.run(f"landing of {name or 'all'}", lambda: self._fleet.land(names), "landed")

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

        def reset() -> str:
            killed = [one for one in self._fleet if one.state.transmitter_state == "killed"]
            for vehicle in killed:
                vehicle.reset()
            return f"reset: {', '.join(one.name for one in killed)}" if killed else "no vehicle is killed"

        self.run("reset", reset)

    def go_to(self, name: Name, place_m: Place, yaw_rad: float) -> None:
        """Send a vehicle to a set point."""
        place = ", ".join(f"{value:.2f}" for value in place_m)
        self.run(
            f"set point of {name}",
            lambda: self._fleet[name].go_to(place_m, yaw_rad),
            f"{name}: on its way to {place} m",
        )

    def move(self, name: Name, place_m: Place) -> None:
        """Send a leader to a place, or give a follower that place beside its leader."""
        state = self._fleet[name].state
        if state.agent is None:
            self.refuse(f"{name} does not report")
        elif not state.assigned:
            self.go_to(name, place_m, state.agent.set_point.yaw_rad)
        else:
            leader = self._fleet[state.assigned[0].leader].state
            if leader.agent is None or leader.position_m is None:
                self.refuse(f"the position of {leader.name} is unknown")
                return
            yaw_rad = leader.agent.yaw_rad or 0.0
            self._follow(name, (link_to(state.assigned[0], place_m, leader.position_m, yaw_rad),))

    def _follow(self, name: str, links: Sequence[LeaderLink]) -> None:
        """Set the leaders of a vehicle, none to let it lead."""
        vehicle = self._fleet[name]
        self.run(f"leaders of {name}", lambda: vehicle.follow(links) if links else vehicle.lead())

    def follow(self, name: Name, leader: Name | None) -> None:
        """Let a vehicle follow another one from its present place, or lead."""
        if leader is None:
            self._follow(name, ())
            return
        own, other = self._fleet[name].state.position_m, self._fleet[leader].state.position_m
        if own is None or other is None:
            self.refuse(f"the position of {name} or {leader} is unknown")
            return
        x, y, z = (round(a - b, 3) for a, b in zip(own, other, strict=True))
        self._follow(name, (LeaderLink(leader=leader, offset_m=(x, y, z)),))

    def formation(self, shape: ShapeName, leader: Name, spacing_m: Spacing) -> None:
        """Bring all flying vehicles into a formation behind a vehicle that leads."""
        flying = [vehicle.name for vehicle in self._fleet if vehicle.state.phase == "flying"]
        if leader not in flying:
            self.refuse(f"{leader} does not fly")
            return
        if self._fleet[leader].state.leaders:
            self.refuse(f"{leader} follows another vehicle; let it lead first")
            return
        followers = [name for name in flying if name != leader]
        for name, link in formation_links(shape, leader, followers, spacing_m).items():
            self._follow(name, (link,))

    def promote(self, name: Name) -> None:
        """Make a vehicle the leader of its formation."""
        self.run("promotion", lambda: "; ".join(self._fleet.promote(name)))

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
        if state.position_m is None or not places_m:
            self.refuse("click waypoints in the scene first")
            return
        before: Sequence[float] = state.position_m
        yaw_rad = 0.0 if state.agent is None else state.agent.set_point.yaw_rad
        rows, time_s = [(0.0, *before, yaw_rad)], 0.0
        for after in places_m:
            time_s += max(PACE_S, math.dist(before, after) / SPEED_M_S)
            rows.append((time_s, *after, yaw_rad))
            before = after
        self.run(f"waypoints of {name}", lambda: self._fleet[name].fly(through(rows)))
