"""The pilot of an agent by its settings."""

from typing import Final

from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.following.leader_plans import followed_leader
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.settings import AgentSettings

LIFT_OFF_TURNS: Final = 3
LIFT_OFF_TURN_S: Final = 0.55
"""`LIFT_OFF_TURNS`, `LIFT_OFF_TURN_S`: vehicles that take off together lift off one after another, in so many
turns, so that the pose of one whose subject or radio is another's rises at the wrong time."""


def build_pilot(settings: AgentSettings) -> Pilot:
    """Return the pilot of the settings; `ValueError` for a name or a setting that does not exist."""
    parts = settings.configuration.parts(settings.model, settings.period_s)
    pilot = Pilot(
        parts.model,
        parts.controller,
        parts.estimator,
        Guidance(
            [followed_leader(link) for link in settings.following], deviation_share=settings.deviation_share
        ),
        settings.separation,
        parts.default_controller,
        parts.default_estimator,
        settings.hover_thrust_limits,
    )
    pilot.cooperation.vehicle = settings.vehicle
    pilot.lift_off_delay_s = (settings.vehicles.index(settings.vehicle) % LIFT_OFF_TURNS) * LIFT_OFF_TURN_S
    pilot.measured_tilt = bool(settings.configuration.estimator_settings.get("measured_tilt", True))
    return pilot
