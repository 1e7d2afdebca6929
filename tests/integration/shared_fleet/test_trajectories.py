"""A leader flies a trajectory with its formation; what cannot be flown is refused, with real processes."""

import numpy as np
import pytest
from integration_support import NAMES, Flying, Truth

from rcopterx.control.references.path_shapes import circle, figure_eight
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.vehicle import RefusedError

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(180)]

ERROR_MM = 80.0
"""Half of it on a machine that does nothing else: previewed and fed forward, far better than set points."""


def test_a_formation_flies_an_eight_and_bad_trajectories_are_refused(flying: Flying, truth: Truth) -> None:
    fleet = flying.fleet
    with pytest.raises(RefusedError, match="outside the flight volume"):
        fleet["h1"].fly(circle((0.0, 0.0, 1.0), 5.0, 20.0))
    with pytest.raises(RefusedError, match="times as slow it could be flown"):
        fleet["h1"].fly(circle((0.0, 0.0, 1.0), 0.5, 1.0, turns=3.0))
    with pytest.raises(RefusedError, match="it follows h1"):
        fleet["h2"].fly(circle((0.0, 0.0, 1.0), 0.5, 8.0))
    recorder = FlightSampler(fleet.session)
    recorder.start()
    answer = fleet["h1"].fly(figure_eight((0.0, 0.0, 0.9), (0.4, 0.2), 5.0), wait=True)
    figures = FlightFigures(recorder.stop(), NAMES)
    assert "on the way to its beginning" in answer
    leader = truth("h1")
    assert leader is not None
    assert np.linalg.norm(np.subtract(leader.position_m, (0.0, 0.0, 0.9))) < 0.15
    for name in NAMES:
        table = figures.vehicle(name)
        assert table["ticks"] > 150
        assert table["tracking_error_mm"]["rms"] < ERROR_MM
    truth.assert_none_touched_down()
