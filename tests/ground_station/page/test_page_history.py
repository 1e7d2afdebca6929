"""Promises of the history: a minute at ten samples a second, gaps included."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.plans import plan_of
from support.statuses import flying_status

from rcopterx.ground_station.page.history import KEPT_S, SAMPLE_S, History
from rcopterx.ground_station.scripting.state import VehicleState

SEEN = VehicleState("h1", flying_status(position_m=(1.0, 2.0, 3.0)), None, 0.1, None, 0.01)


def test_samples_come_at_their_period_however_often_they_are_offered() -> None:
    history = History()
    for number in range(100):
        history.add(0.02 * number, SEEN, (0.1, 0.2, 0.3, 0.4))
    assert len(history.times_s) == 20
    assert (history.column("y_m") == 2.0).all()
    assert (history.column("thrust") == 0.3).all()


def test_only_the_last_minute_is_kept_in_order() -> None:
    history = History()
    for number in range(1000):
        history.add(SAMPLE_S * number, SEEN, None)
    times_s = history.times_s
    assert len(times_s) == round(KEPT_S / SAMPLE_S)
    assert (np.diff(times_s) > 0).all()
    assert times_s[-1] == pytest.approx(99.9)
    assert np.isnan(history.column("pitch")).all()


def test_the_error_is_the_distance_from_the_plans_reference() -> None:
    history = History()
    plan = plan_of("h1", position_m=(1.0, 2.0, 3.0), reference_m=(1.0, 2.1, 3.0))
    history.add(0.0, replace(SEEN, plan=plan), None)
    assert history.column("error_mm") == pytest.approx([100.0])
    assert history.column("reference_y_m") == pytest.approx([2.1])


def test_a_trail_leaves_out_what_was_not_seen() -> None:
    history = History()
    for number in range(30):
        unseen = replace(SEEN, agent=flying_status(position_m=None))
        history.add(SAMPLE_S * number, unseen if number == 25 else SEEN, None)
    assert history.trail_m(1.05).shape == (10, 3)
    assert math.isclose(history.trail_m(100.0)[0, 0], 1.0)
