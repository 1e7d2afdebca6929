"""Everything one agent process needs to know at start."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from rcopterx.agents.flight.vehicle_watch import DEFAULT_LIMITS, HoverThrustLimits
from rcopterx.agents.separation.avoidance import SeparationEllipsoid
from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.session import BusAddress
from rcopterx.formation.placement import Room
from rcopterx.formation.succession import Succession
from rcopterx.vehicles.model import Model


@dataclass(frozen=True)
class AgentSettings:
    """Settings of an agent."""

    bus: BusAddress
    vehicle: str
    vehicles: tuple[str, ...]  # names of all vehicles of the fleet, and of subjects that may lead
    model: Model
    room: Room  # set points outside, and offsets that bring vehicles too close, are refused
    configuration: Configuration = field(default_factory=Configuration)  # controller and estimator at start
    period_s: float = 0.02
    following: tuple[LeaderLink, ...] = ()
    models: Mapping[str, Model] = field(default_factory=dict)  # models of all vehicles of the fleet
    realtime_priority: int = 0
    leader_wait_s: float = 0.003  # wait for the leaders' plans of the same frame, per level above
    deviation_share: float = 0.25  # share of a leader's deviation from its nominal trajectory that it copies
    succession: Succession = field(default_factory=Succession)
    separation: SeparationEllipsoid | None = field(default_factory=SeparationEllipsoid)
    """Ellipsoid around a vehicle that others do not enter; None for no avoidance."""
    hover_thrust_limits: HoverThrustLimits = DEFAULT_LIMITS
    take_over: bool = False  # whether it takes over from an agent that flies the vehicle, once it is warm
