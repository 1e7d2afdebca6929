"""The pilot as the modules below it see it."""

from typing import Protocol

from rcopterx.agents.flight.fleet_clock import FleetClock
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.control.interfaces import Estimate
from rcopterx.vehicles.model import Model


class FlightState(Protocol):
    """Model, clock, estimate and task of a vehicle."""

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
