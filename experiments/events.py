"""Events of a flight in the rig: set points, offsets, leaders."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rcopterx.agents.flight.task import LeaderPlan
from rcopterx.agents.following.leader_plans import followed_leader
from rcopterx.agents.pilot import Pilot
from rcopterx.bus.messages import LeaderLink
from rcopterx.control.references.paths import FlightPath
from rcopterx.control.references.set_points import ProfileLimits
from rcopterx.vehicles.tuples import Three


@dataclass(frozen=True)
class Scene:
    """What a vehicle knows of the others at an event."""

    plans: Mapping[str, LeaderPlan]  # newest plans of `Event.leaders`
    limits: ProfileLimits | None = None  # limits of its ways that followers impose, None without followers


@dataclass(frozen=True)
class Event(ABC):
    """An event of one vehicle at one time [s]."""

    time_s: float
    vehicle: str

    @property
    def leaders(self) -> tuple[str, ...]:
        """Vehicles whose plans the event needs."""
        return ()

    @abstractmethod
    def apply(self, pilot: Pilot, scene: Scene) -> str | None:
        """Apply the event to the pilot; returns the reason of a refusal."""


@dataclass(frozen=True)
class GoTo(Event):
    """New set point of a vehicle that does not follow."""

    position_m: Three
    yaw_rad: float = 0.0

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:
        """Set the set point."""
        place_m, time_s = np.array(self.position_m), pilot.clock.time_s
        return pilot.guidance.go_to(place_m, self.yaw_rad, time_s, scene.limits)


@dataclass(frozen=True)
class Fly(Event):
    """A path of a vehicle that does not follow."""

    path: FlightPath

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:  # noqa: ARG002 - not needed
        """Begin the path."""
        problem = pilot.guidance.flight_problem()
        if problem is None:
            pilot.guidance.fly(self.path, pilot.clock.time_s)
        return problem


@dataclass(frozen=True)
class Follow(Event):
    """New leaders, or new offsets to the same ones, which are reached smoothly.

    The guidance chooses the duration if `transition_s` is None.
    """

    following: tuple[LeaderLink, ...]
    transition_s: float | None = None

    @property
    def leaders(self) -> tuple[str, ...]:
        """The leaders to follow."""
        return tuple(link.leader for link in self.following)

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:
        """Follow them."""
        missing = [leader for leader in self.leaders if leader not in scene.plans]
        if missing:
            return f"no plan from {', '.join(missing)}"
        links = [followed_leader(link) for link in self.following]
        pilot.guidance.follow(links, scene.plans, pilot.estimate, pilot.clock.time_s, self.transition_s)
        return None


@dataclass(frozen=True)
class Lead(Event):
    """Stop following and hold the present place."""

    def apply(self, pilot: Pilot, scene: Scene) -> str | None:  # noqa: ARG002 - not needed
        """Hold the place."""
        pilot.guidance.lead(pilot.estimate)
        return None
