"""Events of a flight in the rig: set points, paths, leaders."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rcopterx.agents.following.leader_plans import followed_leader
from rcopterx.agents.pilot import Pilot
from rcopterx.bus.messages import LeaderLink
from rcopterx.control.references.paths import FlightPath
from rcopterx.control.references.set_points import ProfileLimits
from rcopterx.formation.law import LeaderPlan
from rcopterx.vehicles.tuples import Three


@dataclass(frozen=True)
class PilotEvent:
    """An event of one vehicle at one time [s]."""

    time_s: float
    vehicle: str


@dataclass(frozen=True)
class GoToEvent(PilotEvent):
    """New set point of a vehicle that does not follow."""

    position_m: Three
    yaw_rad: float = 0.0


@dataclass(frozen=True)
class FlyEvent(PilotEvent):
    """A path of a vehicle that does not follow."""

    path: FlightPath


@dataclass(frozen=True)
class FollowEvent(PilotEvent):
    """New leaders, or new offsets to the same ones, which are reached smoothly.

    The guidance chooses the duration if `transition_s` is None.
    """

    following: tuple[LeaderLink, ...]
    transition_s: float | None = None


@dataclass(frozen=True)
class LeadEvent(PilotEvent):
    """Stop following and hold the present place."""


def apply(
    event: PilotEvent, pilot: Pilot, plans: Mapping[str, LeaderPlan], limits: ProfileLimits | None
) -> str | None:
    """Apply an event to the pilot of its vehicle; returns the reason of a refusal.

    `plans`: newest plans of the other vehicles. `limits`: those of its ways that followers impose, None for
    set points that step.
    """
    guidance, time_s = pilot.guidance, pilot.clock.time_s
    match event:
        case GoToEvent():
            return guidance.go_to(guidance.way_to(np.array(event.position_m), event.yaw_rad, time_s, limits))
        case FlyEvent():
            if (problem := guidance.flight_problem()) is not None:
                return problem
            guidance.fly(event.path, time_s)
        case FollowEvent():
            links = [followed_leader(link) for link in event.following]
            if missing := [link.leader for link in links if link.leader not in plans]:
                return f"no plan from {', '.join(missing)}"
            guidance.follow(links, plans, pilot.estimate, time_s, event.transition_s)
        case LeadEvent():
            guidance.lead(pilot.estimate)
    return None
