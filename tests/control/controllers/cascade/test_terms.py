"""A velocity that is measured beyond its bounds comes back to them, and not at once."""

import numpy as np
import pytest

from rcopterx.control.controllers.cascade.terms import let_come_back
from rcopterx.control.controllers.chains.chain import ChainTarget

STAGES = 5
REMAINING = 0.5 ** np.arange(STAGES)
LOWER = np.array([0.0, -9.0, -1.0, -2.5, 0.0, -0.4])
UPPER = np.array([2.0, 9.0, 1.0, 2.5, 1.0, 0.4])
"""Of height and heading, their rates, thrust and yaw stick."""
TARGET = ChainTarget(np.zeros((STAGES, 6)), np.zeros(6), LOWER[None], UPPER[None])


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (1.0, -2.5), (-1.0, 2.5)])
def test_within_the_bounds_nothing_changes(velocity: tuple[float, float]) -> None:
    eased = let_come_back(TARGET, np.array(velocity), REMAINING)
    assert (eased.lower == LOWER).all()
    assert (eased.upper == UPPER).all()


def test_what_is_beyond_a_bound_may_be_so_for_a_while() -> None:
    eased = let_come_back(TARGET, np.array([-1.2, 3.5]), REMAINING)
    assert eased.upper[:, 3] == pytest.approx(2.5 + 1.0 * REMAINING)
    assert eased.lower[:, 2] == pytest.approx(-1.0 - 0.2 * REMAINING)
    kept_lower, kept_upper = [0, 1, 3, 4, 5], [0, 1, 2, 4, 5]
    assert (eased.lower[:, kept_lower] == LOWER[kept_lower]).all()
    assert (eased.upper[:, kept_upper] == UPPER[kept_upper]).all()
    assert (TARGET.upper == UPPER).all()


def test_bounds_that_differ_from_stage_to_stage_keep_doing_so() -> None:
    lower = np.tile(LOWER, (STAGES, 1))
    lower[:, 0] = np.linspace(0.0, 0.4, STAGES)
    crowded = ChainTarget(TARGET.rows, TARGET.terminal, lower, np.tile(UPPER, (STAGES, 1)))
    eased = let_come_back(crowded, np.array([0.0, 2.7]), REMAINING)
    assert (eased.lower == lower).all()
    assert eased.upper[:, 3] == pytest.approx(2.5 + 0.2 * REMAINING)
    assert (crowded.upper == UPPER).all()
