"""Promises of the models: the type with what the file changes."""

from pathlib import Path

import pytest
from support.fleets import PAIR
from support.vehicle_types import COAXIAL, QUADROTOR

from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.vehicle_models import model_of


@pytest.fixture(autouse=True)
def _own_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))


def test_the_model_is_that_of_the_type_with_changes_and_the_bounds_of_the_volume() -> None:
    fleet = parse_fleet(
        PAIR + 'type = "quadrotor"\nmodel = { delay_s = 0.04 }\n[volume]\nmax_m = [3, 3, 2.5]'
    )
    assert model_of(fleet, "h1").input_gain == COAXIAL.input_gain
    model = model_of(fleet, "h2")
    assert (model.kind, model.delay_s, model.lag_s) == ("quadrotor", 0.04, QUADROTOR.lag_s)
    assert model.state_max == (3.0, 3.0, 2.5, *QUADROTOR.state_max[3:])
    assert model.state_min[:3] == fleet.volume.min_m


def test_a_volume_above_the_floor_bounds_set_points_and_not_flights_which_begin_and_end_on_the_floor() -> (
    None
):
    fleet = parse_fleet(PAIR + "[volume]\nmin_m = [-1.0, -1.0, 0.4]\n")
    assert model_of(fleet, "h1").state_min[:3] == (-1.0, -1.0, 0.0)
    assert fleet.volume.min_m[2] == 0.4
