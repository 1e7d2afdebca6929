"""A battery that runs down costs nothing: the estimated disturbance makes up for the missing thrust."""

from dataclasses import replace

import numpy as np
import pytest
from support.conditions import HELICOPTERS
from support.vehicle_types import COAXIAL

from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import Array
from rcopterx_studies.experiments.rig import Rig, RigVehicle

ENDURANCE_S = 30.0
FLIGHT_S = 23.0
"""Three quarters of a battery that lasts half a minute, as some minutes of a usual one."""


def late_hover(sag: float) -> tuple[Array, float]:
    """Root mean squares of x, y, z [m] in the last 11 s, and the mean thrust stick in them."""
    conditions = replace(HELICOPTERS, battery_sag=sag, battery_endurance_s=ENDURANCE_S)
    rig = Rig([RigVehicle("h1", COAXIAL, BodyPose((0.0, 0.0, 1.0)), "cascade")], conditions, seed=4)
    flown = rig.fly(FLIGHT_S)["h1"]
    late = flown.time_s >= FLIGHT_S - 11.0
    errors = (flown.motion[:, :3] - flown.reference[:, :3])[late]
    return np.sqrt(np.mean(errors**2, axis=0)), float(flown.inputs[late, 2].mean())


def test_hover_on_a_battery_that_runs_down_is_as_good_as_on_a_full_one() -> None:
    full, full_thrust = late_hover(0.0)
    low, low_thrust = late_hover(0.15)
    assert low_thrust > 1.06 * full_thrust, "the battery did run down"
    assert low[:2] == pytest.approx(full[:2], rel=0.15)
    assert low[2] < full[2] + 0.002
