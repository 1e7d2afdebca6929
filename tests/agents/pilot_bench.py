"""Pilots with controllers that record their calls, and with real ones."""

import numpy as np
from support.flight import ExactEstimator, NotedController
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.pilot import Pilot
from rcopterx.control.interfaces import Measurement
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
from rcopterx.formation.law import FollowedLeader
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.phases import Phase

HOVER = COAXIAL_LAG.hover_input
UP = (0.1, -0.2, 1.0)


def seen(
    frame: int, position_m: tuple[float, float, float] = UP, period_s: float = 0.02
) -> StampedMeasurement:
    return StampedMeasurement(1, frame, period_s, Measurement(np.array(position_m), 0.0))


def unseen(frame: int) -> StampedMeasurement:
    return StampedMeasurement(1, frame, 0.02, None)


def noted(
    model: Model = COAXIAL_LAG, inputs: np.ndarray | None = None, links: tuple[FollowedLeader, ...] = ()
) -> Pilot:
    inputs = model.hover_input[None, :] if inputs is None else inputs
    return Pilot(model, NotedController(inputs), ExactEstimator(model), Guidance(links))


def airborne(pilot: Pilot, frame: int = 0) -> Pilot:
    """A pilot that finds its vehicle in the air."""
    pilot.observe(seen(frame))
    pilot.note_applied("armed", -1, HOVER)
    assert pilot.guidance.phase is Phase.FLYING
    return pilot


def controller_of(pilot: Pilot) -> NotedController:
    assert isinstance(pilot.controller, NotedController)
    return pilot.controller


def real(controller: str, estimator: str, model: Model = COAXIAL_LAG, horizon: int = 15) -> Pilot:
    return Pilot(
        model,
        CONTROLLERS.build(controller, model, 0.02, {"horizon": horizon}),
        ESTIMATORS.build(estimator, model, 0.02, {}),
        Guidance(),
    )
