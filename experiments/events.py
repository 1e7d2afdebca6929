"""What happens during a flight in the rig: set points, offsets, leaders, controllers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from rcopterx.agents.flight.followed import LeaderPlan
from rcopterx.agents.following.links import followed_leader
from rcopterx.agents.pilot import Pilot
from rcopterx.bus.messages import LeaderLink
from rcopterx.control.controllers.registry import CONTROLLERS
from rcopterx.control.references.paths import FlightPath
from rcopterx.control.references.set_points import TurnLimits
from rcopterx.vehicles.tuples import Three


@dataclass(frozen=True)
class Scene:
    """What a vehicle knows of the others when something happens to it.

    Attributes
    ----------
    plans
        Newest plans of the leaders that are needed for it.
    turn
        How fast it may turn for those it carries round, None for no limit.
    """

    plans: Mapping[str, LeaderPlan]
    turn: TurnLimits | None = None


class Event(Protocol):
    """Something that happens to one vehicle at one time [s]."""

    @property
    def time_s(self) -> float:
        """When."""
        ...

    @property
    def vehicle(self) -> str:
        """To whom."""
        ...

    @property
    def leaders(self) -> tuple[str, ...]:
        """Vehicles whose plans are needed for it."""
        ...

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:
        """Make it happen; a refusal is returned as its reason."""
        ...


@dataclass(frozen=True)
class GoTo:
    """New set point of a vehicle that follows nobody."""

    time_s: float
    vehicle: str
    position_m: Three
    yaw_rad: float = 0.0

    @property
    def leaders(self) -> tuple[str, ...]:
        """See `Event.leaders`."""
        return ()

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:
        """See `Event.apply`."""
        return pilot.guidance.go_to(np.array(self.position_m), self.yaw_rad, pilot.clock.time_s, scene.turn)


@dataclass(frozen=True)
class Fly:
    """A path of a vehicle that follows nobody."""

    time_s: float
    vehicle: str
    path: FlightPath

    @property
    def leaders(self) -> tuple[str, ...]:
        """See `Event.leaders`."""
        return ()

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:  # noqa: ARG002 - not needed
        """See `Event.apply`."""
        problem = pilot.guidance.flight_problem()
        if problem is None:
            pilot.guidance.fly(self.path, pilot.clock.time_s)
        return problem


@dataclass(frozen=True)
class Follow:
    """New leaders, or new offsets to the same ones; offsets move there smoothly.

    `transition_s` None leaves the duration to the guidance.
    """

    time_s: float
    vehicle: str
    following: tuple[LeaderLink, ...]
    transition_s: float | None = None

    @property
    def leaders(self) -> tuple[str, ...]:
        """See `Event.leaders`."""
        return tuple(following.leader for following in self.following)

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:
        """See `Event.apply`."""
        missing = [leader for leader in self.leaders if leader not in scene.plans]
        if missing:
            return f"no plan from {', '.join(missing)}"
        links = [followed_leader(following) for following in self.following]
        pilot.guidance.follow(links, scene.plans, pilot.estimate, pilot.clock.time_s, self.transition_s)
        return None


@dataclass(frozen=True)
class Lead:
    """Follow nobody and hold the present place."""

    time_s: float
    vehicle: str

    @property
    def leaders(self) -> tuple[str, ...]:
        """See `Event.leaders`."""
        return ()

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:  # noqa: ARG002 - not needed
        """See `Event.apply`."""
        pilot.guidance.lead(pilot.estimate)
        return None


@dataclass(frozen=True)
class Switch:
    """Another controller takes over in flight."""

    time_s: float
    vehicle: str
    controller: str
    settings: Mapping[str, object] = field(default_factory=dict)

    @property
    def leaders(self) -> tuple[str, ...]:
        """See `Event.leaders`."""
        return ()

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:  # noqa: ARG002 - not needed
        """See `Event.apply`."""
        controller = CONTROLLERS.build(self.controller, pilot.model, pilot.controller.period_s, self.settings)
        controller.reset(pilot.estimate, pilot.input_history.newest)
        pilot.controller = controller
        return None
