"""Promises of long formations in the rig: followers stay beside their leaders in every graph."""

import numpy as np
import pytest
from support.conditions import HELICOPTERS, LABORATORY

from rcopterx.formation.topology import ancestors, cycle
from rcopterx_studies.experiments import chain
from rcopterx_studies.experiments.chain import (
    SHAPES,
    STEPS_M,
    Absolute,
    cases,
    draw_chain,
    figures,
    fly_helicopters,
    fly_shape,
    generation,
)
from rcopterx_studies.experiments.record import rms
from rcopterx_studies.experiments.runner import FlightResult, Options

EACH_TIME = ("chain_heading", "several_leaders")


@pytest.mark.parametrize(
    "name",
    [name if name in EACH_TIME else pytest.param(name, marks=pytest.mark.campaign) for name in SHAPES],
)
def test_every_follower_stays_beside_its_leaders(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chain, "STEPS_M", STEPS_M[:1])
    errors = fly_shape(SHAPES[name], True, LABORATORY, 0)
    assert errors.keys() == {vehicle for vehicle, own in SHAPES[name].items() if own}
    for vehicle, values in errors.items():
        assert rms(values) < 0.02, vehicle
        assert values.max() < 0.08, vehicle


def test_the_shapes_are_chains_of_five_trees_and_several_leaders_in_both_frames() -> None:
    assert all(cycle(links) == () for links in SHAPES.values())
    for frame in ("inertial", "heading"):
        chain = SHAPES[f"chain_{frame}"]
        assert ancestors(chain, "h5") == ("h4", "h3", "h2", "h1")
        assert {link.frame for own in chain.values() for link in own} == {frame}
    assert [generation(SHAPES["tree"], f"h{number}") for number in range(1, 8)] == [0, 1, 1, 2, 2, 2, 2]
    several = SHAPES["several_leaders"]
    assert [len(several[name]) for name in ("h4", "h5")] == [2, 2]
    assert generation(several, "h5") == 3


def test_figures_are_those_of_all_flights_together() -> None:
    from matplotlib.figure import Figure

    flights = {seed: {f"h{number}": np.array([0.003, 0.004]) for number in (2, 3, 4, 5)} for seed in (0, 1)}
    table = figures("chain_inertial", flights)
    assert table["h3"] == {"generation": 2, "rms_mm": 3.54, "max_mm": 4.0}
    figure = Figure()
    draw_chain(FlightResult(Options((0, 1)), {}, {"chain_inertial": table}), figure)
    assert len(figure.axes) == 1


def test_chains_of_helicopters_are_flown_with_the_default_and_with_plans_alone() -> None:
    names = list(cases(Options((100,), preset="helicopters", knowledge=("default",))))
    assert names[0] == "5 vehicles / default / copies 0.25"
    assert len(names) == 6
    flights = {
        seed: Absolute(np.full(5, 0.003 + seed), np.full(5, 0.01 * seed), np.full(5, 0.004 * seed))
        for seed in (0, 1)
    }
    table = figures(names[0], flights)
    assert table["overshoot_mm"] == 5 * [10.0]
    assert table["step_overshoot_mm"] == 5 * [4.0]
    assert table["hover_mm"] == 5 * [pytest.approx(709.2)]


@pytest.mark.campaign
@pytest.mark.timeout(1200)
def test_errors_do_not_grow_along_a_chain_of_twenty() -> None:
    """The head hovers within 25 mm; a drawn vehicle that alone hovers worse does so in the chain as well."""
    flown, alone = (fly_helicopters(20, "default", share, False, HELICOPTERS, 0) for share in (0.25, 0.0))
    assert flown.overshoot_m.max() < 0.06
    assert flown.step_overshoot_m.max() < 0.03
    assert flown.hover_m[0] < 0.025
    assert (flown.hover_m < 1.1 * alone.hover_m + 0.001).all()
