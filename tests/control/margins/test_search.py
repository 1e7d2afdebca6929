"""Margins say how far a vehicle may be from its model: on this side stable, beyond unstable."""

import math
from dataclasses import replace

import pytest
from support.vehicle_types import COAXIAL, COAXIAL_LAG

from rcopterx.control.margins.axes import lag_loop, tilt_loop
from rcopterx.control.margins.loop import (
    DELAY_LIMIT_S,
    GAIN_LIMIT,
    FeedbackLoop,
    Perturbation,
    margins,
    robustness,
)
from rcopterx.vehicles.model import Departures

PERIOD_S = 0.02
LOOPS = {
    "tilt": tilt_loop(COAXIAL, PERIOD_S, (100.0, 1.0, 0.12)),
    "lag": lag_loop(COAXIAL_LAG, PERIOD_S, 0, (800.0, 1.0, 1.5)),
}


@pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS)
def test_inside_its_margins_a_loop_is_stable_and_beyond_not(loop: FeedbackLoop) -> None:
    found = margins(loop)
    assert 1.0 < found.gain_up < GAIN_LIMIT
    assert 0.0 < found.delay_s < DELAY_LIMIT_S
    assert loop.stable(Perturbation(gain=found.gain_up))
    assert not loop.stable(Perturbation(gain=1.02 * found.gain_up))
    assert loop.stable(Perturbation(delay_s=found.delay_s))
    assert not loop.stable(Perturbation(delay_s=found.delay_s + 0.003))
    assert loop.stable(Perturbation(frequency=found.frequency_down))
    assert not loop.stable(Perturbation(frequency=0.98 * found.frequency_down))


def test_an_unstable_loop_has_no_margins() -> None:
    loop = LOOPS["lag"]
    backwards = FeedbackLoop(
        loop.plant_step, loop.measured, loop.filter_step, loop.filter_measured, loop.filter_gain,
        -loop.feedback, loop.period_s, loop.delay_s, loop.rule,
    )  # fmt: skip
    found = margins(backwards)
    assert (found.gain_up, found.gain_down, found.phase_rad, found.delay_s) == (1.0, 1.0, 0.0, 0.0)
    borne = robustness(backwards)
    assert len(borne.unstable_alone) == 5
    assert borne.corner_sensitivities == 8 * (math.inf,)
    assert borne.weak_corners == 8
    assert borne.peak_sensitivity == math.inf
    assert borne.shortfalls == (*borne.unstable_alone, "corners", "sensitivity")


def test_phase_and_delay_margins_belong_to_the_same_crossing() -> None:
    """A delay shifts the phase by the crossing's frequency times the delay: both say 1 to 2 Hz here."""
    found = margins(LOOPS["lag"])
    assert 0.5 < found.phase_rad / found.delay_s / math.tau < 3.0


def test_what_falls_short_of_the_rule_is_named() -> None:
    rule = Departures(1.7, 0.03, 0.25)
    aggressive = replace(tilt_loop(COAXIAL, PERIOD_S, (100.0, 1.0, 0.002)), rule=rule)
    borne = robustness(aggressive)
    assert {"frequency down", "delay", "corners", "sensitivity"} <= set(borne.shortfalls)
    assert borne.shortage == len(borne.shortfalls) + borne.weak_corners
    gentle = robustness(tilt_loop(COAXIAL, PERIOD_S, (100.0, 25.0, 30.0)))
    assert gentle.shortfalls == ()
    assert gentle.shortage == 0


def test_departures_that_are_borne_alone_are_not_all_borne_together() -> None:
    loop = tilt_loop(COAXIAL, PERIOD_S, (100.0, 40.0, 1.5))
    borne = robustness(loop)
    assert borne.unstable_alone == ()
    assert 0 < borne.weak_corners < len(borne.corner_sensitivities) == 16
