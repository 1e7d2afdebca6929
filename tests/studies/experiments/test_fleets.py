"""Formations of drawn helicopters."""

import pytest
from support.conditions import HELICOPTERS

from rcopterx_studies.experiments import fleets, formation
from rcopterx_studies.experiments.fleets import FlownFleet, figures, fly_fleet
from rcopterx_studies.experiments.formation import SLOTS
from rcopterx_studies.experiments.knowledge import LEVELS
from rcopterx_studies.experiments.runner import Options


def test_fleet_of_drawn_helicopters_keeps_its_formation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleets, "sequence", lambda _quick: SLOTS[:1])
    for module in (fleets, formation):
        monkeypatch.setattr(module, "SLOT_S", 4.0)
    flown = fly_fleet("default", quick=True, conditions=HELICOPTERS, seed=1)
    assert 0.0 < flown.rms_mm < 45.0
    assert flown.rms_mm < flown.max_mm < 220.0
    assert (flown.lost, flown.touched_floor) == (False, False)
    assert flown.fallbacks == 0


def test_figures_are_those_of_the_worst_fleet() -> None:
    table = figures(
        "default",
        {
            100: FlownFleet(20.0, 80.0, False, False, 0),
            101: FlownFleet(30.0, 70.0, True, False, 2),
            102: FlownFleet(25.0, 60.0, False, True, 0),
        },
    )
    assert table["rms_mm"] == {"median": 25.0, "median_95%": [20.0, 30.0], "worst": 30.0}
    assert table["max_mm"] == {"median": 70.0, "median_95%": [60.0, 80.0], "worst": 80.0}
    assert (table["lost"], table["touched_floor"], table["fallbacks"]) == ([101], [102], 2)
    assert table["per_fleet"]["101"] == {"rms_mm": 30.0, "max_mm": 70.0}


def test_every_level_is_flown_and_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleets, "fly_fleet", lambda *_, **__: FlownFleet(20.0, 80.0, False, False, 0))
    labels: list[str] = []
    result = fleets.EXPERIMENT.fly(
        Options((100, 101), preset="helicopters"), lambda label, _: labels.append(label)
    )
    assert set(result.document) == set(LEVELS)
    assert set(labels) == {f"{level}, helicopters, seed {seed}" for level in LEVELS for seed in (100, 101)}
    assert set(fleets.EXPERIMENT.levels) == {*LEVELS, "learned"}


@pytest.mark.campaign
def test_a_fleet_that_has_learned_in_ordinary_flight_keeps_its_formation_better() -> None:
    default, learned = (
        fly_fleet(level, quick=True, conditions=HELICOPTERS, seed=1) for level in ("default", "learned")
    )
    assert learned.rms_mm < 0.85 * default.rms_mm
    assert learned.rms_mm < 18.0
    assert (learned.lost, learned.touched_floor, learned.fallbacks) == (False, False, 0)
