"""What the parts of an agent that decide about flight see of its pilot."""

from typing import Protocol

from rcopterx.agents.flight.fleet_clock import FleetClock
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.control.interfaces import Estimate
from rcopterx.vehicles.model import Model


class FlightState(Protocol):
    """A flying vehicle: what it is, where it is, what time it is for it, and what it is to do."""

    @property
    def model(self) -> Model:
        """Nominal model of the vehicle."""
        ...

    @property
    def clock(self) -> FleetClock:
        """The fleet's time."""
        ...

    @property
    def estimate(self) -> Estimate:
        """Present estimate."""
        ...

    @property
    def guidance(self) -> Guidance:
        """Phase and task."""
        ...
