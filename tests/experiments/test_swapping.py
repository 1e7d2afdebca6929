"""Vehicles that swap places keep their distance."""

import numpy as np
import pytest

from rcopterx.experiments.swapping import (
    ANTIPODES,
    CASES,
    HARD_M,
    RANDOM,
    WITHOUT,
    draw_swapping,
    figures,
    fly_swap,
    goals_of,
    places,
)
from rcopterx.simulator.conditions import LABORATORY


@pytest.mark.parametrize("case", [ANTIPODES, RANDOM])
def test_all_vehicles_arrive_and_keep_their_distance(case: str) -> None:
    table = figures(fly_swap(case, LABORATORY, 3, quick=True))
    assert table["minimum_distance_m"] > HARD_M
    assert table["finished_s"] is not None
    assert table["fallbacks"] == 0


def test_vehicles_would_collide_without_avoidance() -> None:
    table = figures(fly_swap(WITHOUT, LABORATORY, 0, quick=True))
    assert table["minimum_distance_m"] < 0.5 * HARD_M


@pytest.mark.parametrize("case", CASES)
def test_every_vehicle_has_a_goal_of_its_own(case: str) -> None:
    goals = goals_of(case, 10, 3)
    assert sorted(map(tuple, goals.round(6).tolist())) == sorted(map(tuple, places(10).round(6).tolist()))
    if case != RANDOM:
        assert goals[:, :2] == pytest.approx(-places(10)[:, :2])


def test_figure_shows_tracks_and_distances() -> None:
    from matplotlib.figure import Figure

    swap = fly_swap(ANTIPODES, LABORATORY, 0, quick=True)
    figure = Figure()
    draw_swapping({(ANTIPODES, 0): swap, (RANDOM, 0): swap, (WITHOUT, 0): swap}, "laboratory", figure)
    assert len(figure.axes) == 3
    assert np.isfinite(swap.nearest_normalised()).all()
