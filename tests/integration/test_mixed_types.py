"""A helicopter, a quadrotor and another helicopter in one formation, with real processes and radios."""

from collections.abc import Callable

import numpy as np
import pytest
from integration_support import Flying, fleet_text

from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import FlightSampler

pytestmark = [pytest.mark.integration, pytest.mark.campaign, pytest.mark.timeout(120)]

Launch = Callable[..., Flying]
NAMES = ("h1", "q1", "h2")
ERROR_MM = 150.0
"""Of any follower nine times out of ten, on a machine that has other work to do as well."""
RADIOS = {"h1": "multi", "q1": "multi", "h2": "dsm2_serial"}

VEHICLES = "\n".join(
    f"""
[vehicles.{name}]
type = "{"quadrotor" if name == "q1" else "coaxial"}"
subject = "subject-{name}"
transmitter = {{ port = "radio-{name}", protocol = "{RADIOS[name]}", model_match = {number} }}
{"" if name == "h1" else f'follow = [{{ leader = "h1", offset_m = [-0.4, {0.5 * (-1) ** number}, 0.0] }}]'}
"""
    for number, name in enumerate(NAMES, 1)
)


def test_helicopters_and_a_quadrotor_fly_one_formation_and_either_type_leads(launch: Launch) -> None:
    control = 'controller = "cascade"\nhorizon = 30'
    flying = launch(fleet_text(vehicles=VEHICLES, control=control))
    fleet = flying.fleet
    models = {name: model_of(load_fleet(flying.path), name) for name in NAMES}
    assert {name: model.kind for name, model in models.items()} == {
        "h1": "coaxial", "q1": "quadrotor", "h2": "coaxial",
    }  # fmt: skip
    fleet.take_off(NAMES, height_m=0.7, timeout_s=40)
    fleet.wait_for_formation()
    recorder = FlightSampler(fleet.session)
    recorder.start()
    fleet["h1"].go_to((0.3, 0.2, 0.9), 0.4)
    fleet.wait_for_arrival(["h1"])
    fleet.wait_for_formation()
    assert "q1 leads" in fleet.promote("q1")
    fleet["q1"].go_to((-0.2, 0.5, 0.7), 0.0)
    fleet.wait_for_arrival(["q1"])
    fleet.wait_for_formation()
    figures = FlightFigures(recorder.stop(), NAMES)
    for name in NAMES:
        errors_m = figures.formation_error_m(name)
        assert len(errors_m) > 20, name
        assert 1000 * np.percentile(errors_m, 90) < ERROR_MM, name
        thrusts = [applied.input[2] for applied in figures.applied[name]]
        assert np.median(thrusts) == pytest.approx(models[name].hover_input[2], abs=0.05), name
