"""Promises of the bumpless transfer: sticks continue from where they were and reach the new inputs."""

import numpy as np
from support.vehicle_types import COAXIAL

from rcopterx.agents.flight.timeline import BumplessTransfer

LAST = COAXIAL.hover_input + 0.2
ASKED = np.tile(COAXIAL.hover_input, (5, 1))


def test_inputs_pass_as_they_are_while_nothing_changes() -> None:
    assert (BumplessTransfer(COAXIAL).smoothed(ASKED, LAST, 0.02) == ASKED).all()


def test_after_a_change_the_difference_fades_away_period_by_period_and_within_a_plan() -> None:
    transfer = BumplessTransfer(COAXIAL)
    transfer.begin()
    plan = transfer.smoothed(ASKED, LAST, 0.02)
    flown = plan[0]
    distances = [np.abs(flown - ASKED[0]).max()]
    for row in plan[1:]:
        following = transfer.smoothed(ASKED, flown, 0.02)[0]
        np.testing.assert_allclose(following, row)
        flown = following
        distances.append(np.abs(flown - ASKED[0]).max())
    assert 0.1 < distances[0] < 0.2
    assert (np.diff(distances) < 0.0).all()
    for _ in range(50):
        flown = transfer.smoothed(ASKED, flown, 0.02)[0]
    assert (flown == ASKED[0]).all()


def test_what_is_left_of_a_difference_keeps_the_limits() -> None:
    transfer = BumplessTransfer(COAXIAL)
    transfer.begin()
    inputs = transfer.smoothed(np.tile(COAXIAL.u_max - 0.01, (5, 1)), COAXIAL.u_max + 5.0, 0.02)
    assert (inputs <= COAXIAL.u_max).all()


def test_a_difference_fades_in_the_same_time_at_any_control_period() -> None:
    def left_after(seconds: float, period_s: float) -> float:
        transfer, flown = BumplessTransfer(COAXIAL), LAST
        transfer.begin()
        for _ in range(round(seconds / period_s)):
            flown = transfer.smoothed(ASKED, flown, period_s)[0]
        return float(np.abs(flown - ASKED[0]).max())

    left = [left_after(0.1, period_s) for period_s in (0.005, 0.01, 0.02)]
    np.testing.assert_allclose(left, left[0])
