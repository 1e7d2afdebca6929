"""The family experiment: drawn helicopters through the whole programme, and their distribution."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from support.conditions import COAXES, CRAZYFLIES, HELICOPTERS

from rcopterx.commands.output import write_plot
from rcopterx_studies.experiments import family
from rcopterx_studies.experiments.family import (
    LIMIT_CYCLE_MRAD,
    LIMIT_CYCLE_STICK,
    QUICK_PROGRAMME,
    FlownFamily,
    distribution,
    fly_member,
    levels_of,
)
from rcopterx_studies.experiments.knowledge import LEVELS, Knowledge
from rcopterx_studies.experiments.runner import Options
from rcopterx_studies.experiments.schemes import FlownScheme

GOOD = FlownFamily(10.0, 3.0, 30.0, 0.1, 0.1, 40.0, 40.0, 20.0, 40.0, 1.1, False, False, 0)


def test_default_configuration_flies_a_drawn_helicopter_through_the_programme() -> None:
    flown = fly_member(levels_of(LEVELS)["default / tilt measured"], QUICK_PROGRAMME, HELICOPTERS, 1)
    assert flown.hover_mm < 40
    assert flown.stick < 0.25
    assert flown.eight_mm <= flown.eight_max_mm < 150
    assert 1.0 < flown.climb_s < 3.0
    assert (flown.lost, flown.touched_floor, flown.limit_cycle) == (False, False, False)
    assert flown.fallbacks == 0


def test_default_configuration_flies_a_drawn_crazyflie_through_the_programme() -> None:
    flown = fly_member(levels_of(LEVELS)["default / tilt measured"], QUICK_PROGRAMME, CRAZYFLIES, 1)
    assert flown.hover_mm < 20
    assert flown.eight_mm <= flown.eight_max_mm < 100
    assert (flown.lost, flown.touched_floor, flown.limit_cycle) == (False, False, False)
    assert flown.fallbacks == 0


@pytest.mark.parametrize("known", ["default", pytest.param("learned", marks=pytest.mark.campaign)])
def test_vehicle_like_a_real_one_flies_through_the_programme(known: Knowledge) -> None:
    (scheme, _) = levels_of([known]).values()
    flown = fly_member(scheme, QUICK_PROGRAMME, COAXES, 1)
    assert flown.hover_mm < 40
    assert flown.eight_mm <= flown.eight_max_mm < 150
    assert (flown.lost, flown.touched_floor, flown.limit_cycle) == (False, False, False)


def test_vehicle_that_oscillates_is_a_limit_cycle() -> None:
    stiff = FlownScheme("stiff", "Stiff", "pid", {"proportional": (60.0, 60.0, 6.0, 12.0)}, horizon=10)
    flown = fly_member(
        stiff, replace(QUICK_PROGRAMME, settled_s=1.0, hover_s=3.0, slot_s=1.0), HELICOPTERS, 1
    )
    assert flown.limit_cycle


def test_heading_that_swings_is_a_limit_cycle_as_well() -> None:
    assert not GOOD.limit_cycle
    assert replace(GOOD, yaw_mrad=LIMIT_CYCLE_MRAD + 1).limit_cycle
    assert replace(GOOD, stick_deviation=LIMIT_CYCLE_STICK + 0.01).limit_cycle


def test_distribution_names_the_worst_vehicle_and_all_that_failed() -> None:
    vehicles = {seed: replace(GOOD, hover_mm=float(seed - 99)) for seed in range(100, 121)}
    vehicles[105] = replace(GOOD, hover_mm=6.0, lost=True)
    vehicles[107] = replace(GOOD, hover_mm=8.0, stick_deviation=LIMIT_CYCLE_STICK + 0.01, fallbacks=3)
    table = distribution(vehicles)
    assert table["hover_mm"] == {"median": 11.0, "95%": 20.0, "worst": 21.0, "worst_seed": 120}
    assert table["vehicles"] == 21
    assert (table["lost"], table["limit_cycles"], table["touched_floor"]) == ([105], [107], [])
    assert table["fallbacks"] == 3


def test_every_level_is_flown_and_drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(family, "fly_member", lambda *_, seed, **__: replace(GOOD, hover_mm=float(seed)))
    labels: list[str] = []
    result = family.EXPERIMENT.fly(
        Options((100, 101, 102), preset="helicopters"), lambda label, _: labels.append(label)
    )
    assert set(result.document) == {"default", "identified", "exact"}
    for levels in result.document.values():
        assert set(levels) == {"tilt measured", "positions only"}
        for table in levels.values():
            assert table["hover_mm"]["worst"] == 102.0
    assert len(set(labels)) == 3 * 6
    write_plot(partial(family.draw_family, result), tmp_path / "family.svg")
    assert (tmp_path / "family.svg").stat().st_size > 10_000


def test_levels_differ_in_the_measurements_of_the_estimator_and_in_the_model() -> None:
    schemes = levels_of(LEVELS).values()
    assert {(scheme.knowledge, scheme.estimator_settings["measured_tilt"]) for scheme in schemes} == {
        ("default", True),
        ("default", False),
        ("identified", True),
        ("identified", False),
        ("exact", True),
        ("exact", False),
    }
    assert all(scheme.settings == {} for scheme in schemes)
