"""The hovering experiment on short flights."""

import numpy as np
import pytest
from support.conditions import LABORATORY

from rcopterx_studies.experiments.hover import SCHEMES, figures, fly_hover


def test_cascade_hovers_better_than_the_papers_scheme_and_that_better_than_its_predecessor() -> None:
    squares = {
        scheme.name: np.mean(np.square(fly_hover(scheme, 15.0, LABORATORY, 0)), axis=0) for scheme in SCHEMES
    }
    assert (squares["cascade"] < squares["paper"] / 2).all()
    assert (squares["paper"][:2] < squares["kunz_2013"][:2]).all()
    assert (np.sqrt(squares["cascade_50"][:3]) < 0.005).all()


def test_figures_of_hovering_are_mean_squares_and_their_roots() -> None:
    flights = {0: np.array([[0.001, 0.002, 0.0, 0.01]]), 1: np.array([[0.001, 0.0, 0.003, -0.01]])}
    table = figures("cascade", flights)
    assert table["x"] == {"rms_mm": 1.0, "mean_square_mm2": 1.0}
    assert table["y"]["mean_square_mm2"] == pytest.approx(2.0)
    assert table["z"]["rms_mm"] == pytest.approx(np.sqrt(4.5), abs=1e-3)
    assert table["yaw"] == {"rms_rad": 0.01, "mean_square_rad2": 0.0001}
