"""Vehicles that are identified in flight hover better than those of which only the type is known."""

from dataclasses import replace

import numpy as np
import pytest
from support.conditions import CRAZYFLIES, HELICOPTERS
from support.vehicle_types import COAXIAL

from rcopterx.control.identification.fit import identify
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.model import IDENTIFIED, Model
from rcopterx.vehicles.state import Array
from rcopterx_studies.experiments.knowledge import (
    NotIdentifiedError,
    excited_flight,
    identified_model,
    known_model,
    plant_type,
)
from rcopterx_studies.experiments.rig import Rig, RigVehicle

SEED = 2


def hover_m(model: Model) -> Array:
    """Root mean squares of x, y, z in the last 12 s of 20."""
    vehicle = RigVehicle("h1", model, BodyPose((0.0, 0.0, 1.0)), "cascade", plant_type=COAXIAL)
    flown = Rig([vehicle], HELICOPTERS, SEED).fly(20.0)["h1"]
    errors = (flown.motion[:, :3] - flown.reference[:, :3])[flown.time_s >= 8.0]
    return np.sqrt(np.mean(errors**2, axis=0))


def test_an_identified_helicopter_hovers_better_than_its_type(monkeypatch: pytest.MonkeyPatch) -> None:
    # Half of the usual excitation is enough.
    monkeypatch.setattr("rcopterx_studies.experiments.knowledge.EXCITED_S", 35.0)
    flight = excited_flight(HELICOPTERS, "h1", SEED, measured_tilt=True)
    found = identify(flight, plant_type(HELICOPTERS))
    assert found.problems == ()
    before, after = hover_m(COAXIAL), hover_m(found.model)
    assert after[:2].max() < 0.012
    assert after[:2].max() < 0.7 * before[:2].max()
    assert after[2] < 0.005


def test_a_crazyflie_is_identified_and_its_uncertainty_narrows() -> None:
    found, true = (
        identify(excited_flight(CRAZYFLIES, "h1", SEED, measured_tilt=True), plant_type(CRAZYFLIES)),
        known_model("exact", CRAZYFLIES, "h1", SEED),
    )
    assert (found.problems, found.remarks) == ((), ())
    assert found.model.input_gain == pytest.approx(true.input_gain, rel=0.06)
    assert found.model.lag_s[2] == pytest.approx(true.lag_s[2], rel=0.1)
    assert found.model.tilt is not None
    assert true.tilt is not None
    assert found.model.tilt.frequency_rad_s == pytest.approx(true.tilt.frequency_rad_s, rel=0.03)
    uncertainty, ratio = found.model.uncertainty, found.model.tilt.damping_ratio
    assert replace(uncertainty, tilt_damping=None) == IDENTIFIED
    assert uncertainty.tilt_damping == pytest.approx((ratio / 1.25, 1.25 * ratio))


@pytest.mark.campaign
def test_a_vehicle_that_gusts_blow_out_of_its_box_is_not_identified() -> None:
    storm = replace(HELICOPTERS, turbulence_rms=(3.0, 3.0, 0.5, 0.5))
    with pytest.raises(NotIdentifiedError, match=r"h1, seed 2: .* m from its place"):
        excited_flight(storm, "h1", SEED, measured_tilt=True)
    assert identified_model(storm, "h1", SEED, measured_tilt=True) is COAXIAL
