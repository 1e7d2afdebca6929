"""Helicopters beyond the family."""

from typing import Any

import pytest

from rcopterx.experiments import beyond
from rcopterx.experiments.beyond import DEPARTURES, fly_departure, times
from rcopterx.experiments.family import Flown, Programme
from rcopterx.experiments.runner import Options
from rcopterx.simulator.conditions import HELICOPTERS
from rcopterx.simulator.helicopter import helicopter_of

SHORT = Programme(settled_s=2.0, hover_s=4.0, slot_s=0.5, rest_s=0.2, eight_s=2.0)


def test_parameters_are_multiplied() -> None:
    drawn = helicopter_of("h1", HELICOPTERS, 0)
    changed = times(servo_lag_s=2.0, bar_time_constant_s=1.5)(drawn)
    assert changed.servo_lag_s == pytest.approx([2.0 * lag_s for lag_s in drawn.servo_lag_s])
    assert changed.bar_time_constant_s == pytest.approx(1.5 * drawn.bar_time_constant_s)
    assert changed.mass_kg == drawn.mass_kg


def test_changed_vehicle_is_the_one_that_flies() -> None:
    usual = fly_departure("none", SHORT, HELICOPTERS, 0)
    changed = fly_departure("gain of pitch and roll 0.6", SHORT, HELICOPTERS, 0)
    assert not usual.lost
    assert usual.stick < changed.stick


def test_every_departure_is_flown_and_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    def fly(*_: object, seed: int, **__: Any) -> Flown:
        return Flown(float(seed), 3.0, 30.0, 0.1, 0.1, 40.0, 40.0, 20.0, 40.0, seed == 2, False, 0)

    monkeypatch.setattr(beyond, "fly_departure", fly)
    result = beyond.EXPERIMENT.fly(Options((1, 2), preset="helicopters"), lambda *_: None)
    assert list(result.document) == list(DEPARTURES)
    assert all(table["lost"] == [2] for table in result.document.values())
