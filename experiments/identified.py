"""Identification of simulated helicopters in the rig, with the excitation of `rcopterx identify`."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Final

import numpy as np

from rcopterx.control.identification.excitation import DONE, UNDER_WAY, excitation_for
from rcopterx.control.identification.fit import Identification, identify
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.experiments.rig import Rig, RigVehicle
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.tuples import Three
from rcopterx.vehicles.types import COAXIAL

EXCITED_S: Final = 70.0
SETTLING_S: Final = 6.0
REACH_M: Final = 0.4
PLACE_M: Final[Three] = (0.0, 0.0, 1.0)
POSITIONS_ONLY: Final[Mapping[str, object]] = {"measured_tilt": False}


class NotIdentifiedError(ValueError):
    """The excitation ended early; the message says why."""


def excited_flight(conditions: Conditions, name: str, seed: int, measured_tilt: bool) -> FlightRecording:
    """Hover a vehicle of which only the type is known, and excite its sticks; returns the excited part.

    Raises
    ------
    NotIdentifiedError
        The excitation ended early.
    """
    vehicle = RigVehicle(
        name, COAXIAL, Pose(PLACE_M), "cascade", estimator_settings={} if measured_tilt else POSITIONS_ONLY
    )
    rig = Rig([vehicle], conditions, seed)
    rig.fly(SETTLING_S)
    pilot, log = rig.pilots[name], rig.log(name)
    excitation = excitation_for(COAXIAL, EXCITED_S)
    pilot.exciter.begin(excitation, np.array(PLACE_M), REACH_M, pilot.clock.time_s)
    rig.fly(EXCITED_S)
    if pilot.exciter.outcome not in (UNDER_WAY, DONE):
        raise NotIdentifiedError(f"{name}, seed {seed}: {pilot.exciter.outcome}")
    recording = log.recording()
    return recording if measured_tilt else recording.without_tilt()


def identification(conditions: Conditions, name: str, seed: int, measured_tilt: bool) -> Identification:
    """Identify a vehicle; arguments and errors of `excited_flight`."""
    return identify(excited_flight(conditions, name, seed, measured_tilt), COAXIAL)


@lru_cache(maxsize=256)
def identified_model(conditions: Conditions, name: str, seed: int, measured_tilt: bool) -> Model:
    """Model that an identification found; that of the type where it was refused."""
    try:
        found = identification(conditions, name, seed, measured_tilt)
    except NotIdentifiedError:
        return COAXIAL
    return COAXIAL if found.problems else found.model
