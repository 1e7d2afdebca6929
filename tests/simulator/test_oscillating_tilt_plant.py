"""Promises of the simulated vehicle whose tilt is a plain oscillator."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rcopterx.simulator.conditions import IDEAL
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.oscillating_tilt_plant import OscillatingTiltPlant, TiltOscillator
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.state import XD_BODY
from rcopterx.vehicles.types import COAXIAL_LAG

PROMPT = replace(IDEAL, transport_delay_s=0.0)
HIGH = Pose((0.0, 0.0, 50.0))
oscillators = st.builds(TiltOscillator, st.floats(5.0, 30.0), st.floats(0.05, 1.5))


def flying(oscillator: TiltOscillator) -> OscillatingTiltPlant:
    plant = OscillatingTiltPlant("h1", COAXIAL_LAG, PROMPT, 0, HIGH, oscillator)
    plant.set_input((0.3, -0.2, float(COAXIAL_LAG.hover_input[2]), 0.0))
    return plant


@settings(max_examples=20, deadline=None)
@given(oscillators)
def test_tilt_and_speed_agree_with_the_equation_of_the_oscillator(oscillator: TiltOscillator) -> None:
    w, zeta, gain, drag = oscillator.frequency_rad_s, oscillator.damping_ratio, 2.0, -0.5

    def derivative(_: float, state: np.ndarray) -> list[float]:
        value, rate, speed = state
        return [rate, w * w * (0.3 - value) - 2.0 * zeta * w * rate, gain * value + drag * speed]

    value, _, speed = solve_ivp(derivative, (0.0, 0.7), [0.0, 0.0, 0.0], rtol=1e-9, atol=1e-11).y[:, -1]
    plant = flying(oscillator)
    plant.advance(0.7)
    assert plant.motion[XD_BODY] == pytest.approx(speed, abs=2e-4)
    assert np.tan(plant.pose.pitch_rad) * COAXIAL_LAG.gravity_m_s2 / gain == pytest.approx(value, abs=1e-6)


@settings(max_examples=20, deadline=None)
@given(oscillators, st.lists(st.floats(0.0, 0.05), max_size=8))
def test_flight_does_not_depend_on_how_time_is_cut(oscillator: TiltOscillator, cuts: list[float]) -> None:
    whole, cut = flying(oscillator), flying(oscillator)
    whole.advance(0.4)
    for duration_s in cuts:
        cut.advance(min(duration_s, 0.4 - cut.time_s))
    cut.advance(0.4 - cut.time_s)
    assert cut.pose.pitch_rad == pytest.approx(whole.pose.pitch_rad, abs=1e-9)
    assert cut.motion == pytest.approx(whole.motion, abs=1e-4)


def test_a_constant_stick_does_what_it_does_to_a_lag() -> None:
    plant = flying(TiltOscillator(12.0, 0.5))
    plant.advance(8.0)
    assert plant.motion[XD_BODY] == pytest.approx(0.3 * 2.0 / 0.5, rel=0.03)


@pytest.mark.parametrize("wrong", [(0.0, 0.5), (12.0, 0.0), (12.0, float("nan"))])
def test_an_oscillator_that_is_none_is_refused(wrong: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="must be above 0"):
        TiltOscillator(*wrong)


def test_a_laboratory_flies_it_by_name() -> None:
    models, start = dict.fromkeys(("h1", "h2"), COAXIAL_LAG), dict.fromkeys(("h1", "h2"), HIGH)
    laboratory = Laboratory(models, start, IDEAL, 0, {"h2": TiltOscillator(12.0, 0.3)})
    assert [isinstance(laboratory.plant(name), OscillatingTiltPlant) for name in models] == [False, True]
