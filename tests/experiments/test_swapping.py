"""Vehicles that swap places keep their distance."""

import pytest

from rcopterx.experiments.runner import Options, Result
from rcopterx.experiments.swapping import (
    ANTIPODES,
    CASES,
    HARD_M,
    RANDOM,
    WITHOUT,
    draw_swapping,
    figures_of,
    fly_swap,
    goals_of,
    places,
)
from rcopterx.simulator.conditions import LABORATORY


@pytest.mark.parametrize("case", [ANTIPODES, RANDOM])
def test_all_vehicles_arrive_and_keep_their_distance(case: str) -> None:
    table = figures_of(fly_swap(case, True, LABORATORY, 3))
    assert table["minimum_distance_m"] > HARD_M
    assert table["finished_s"] is not None
    assert table["fallbacks"] == 0


def test_vehicles_would_collide_without_avoidance() -> None:
    table = figures_of(fly_swap(WITHOUT, True, LABORATORY, 0))
    assert table["minimum_distance_m"] < 0.5 * HARD_M


@pytest.mark.parametrize("case", CASES)
def test_every_vehicle_has_a_goal_of_its_own(case: str) -> None:
    goals = goals_of(case, 10, 3)
    assert sorted(map(tuple, goals.round(6).tolist())) == sorted(map(tuple, places(10).round(6).tolist()))
    if case != RANDOM:
        assert goals[:, :2] == pytest.approx(-places(10)[:, :2])


def test_figure_shows_tracks_and_distances() -> None:
    from matplotlib.figure import Figure

    swap = fly_swap(ANTIPODES, True, LABORATORY, 0)
    figure = Figure()
    draw_swapping(Result(Options((0,)), {"laboratory": {case: {0: swap} for case in CASES}}, {}), figure)
    assert len(figure.axes) == 3
