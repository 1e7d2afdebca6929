"""The hovering experiment on short flights."""

import numpy as np
import pytest

from rcopterx.experiments.hover import LAG_SCHEMES, figures, fly_hover, over_vehicles, schemes_in
from rcopterx.experiments.schemes import ABLATIONS, HELICOPTER_SCHEMES
from rcopterx.simulator.conditions import HELICOPTERS, LABORATORY


def test_cascade_hovers_better_than_the_papers_scheme_and_that_better_than_its_predecessor() -> None:
    squares = {
        scheme.name: np.mean(np.square(fly_hover(scheme, 15.0, LABORATORY, 0)), axis=0)
        for scheme in LAG_SCHEMES
    }
    assert (squares["cascade"] < squares["paper"] / 2).all()
    assert (squares["paper"][:2] < squares["kunz_2013"][:2]).all()
    assert (np.sqrt(squares["cascade_50"][:3]) < 0.005).all()


def test_helicopters_hover_by_every_scheme_and_by_the_cascade_without_each_of_its_parts() -> None:
    assert schemes_in(LABORATORY) == LAG_SCHEMES
    flown = {scheme.name: scheme for scheme in schemes_in(HELICOPTERS)}
    assert list(flown) == [*HELICOPTER_SCHEMES, *ABLATIONS]
    known, unknown = (
        np.sqrt(np.mean(np.square(fly_hover(flown[name], 12.0, HELICOPTERS, 1)), axis=0))
        for name in ("cascade_exact", "cascade")
    )
    assert (known[:2] < unknown[:2]).all()


def test_figures_of_hovering_are_mean_squares_and_their_roots() -> None:
    flights = {0: np.array([[0.001, 0.002, 0.0, 0.01]]), 1: np.array([[0.001, 0.0, 0.003, -0.01]])}
    table = figures("cascade", flights)
    assert table["x"] == {"rms_mm": 1.0, "mean_square_mm2": 1.0}
    assert table["y"]["mean_square_mm2"] == pytest.approx(2.0)
    assert table["z"]["rms_mm"] == pytest.approx(np.sqrt(4.5), abs=1e-3)
    assert table["yaw"] == {"rms_rad": 0.01, "mean_square_rad2": 0.0001}


def test_drawn_vehicles_are_compared_by_their_worse_axis() -> None:
    some, other = np.array([[0.001, 0.003, 0.002, 0.01]]), np.array([[0.007, 0.0, -0.004, -0.03]])
    assert over_vehicles([some, other]) == {
        "horizontal_mm": {"median": 5.0, "median_95%": [3.0, 7.0], "worst": 7.0},
        "height_mm": {"median": 3.0, "median_95%": [2.0, 4.0], "worst": 4.0},
        "yaw_mrad": {"median": 20.0, "median_95%": [10.0, 30.0], "worst": 30.0},
    }
