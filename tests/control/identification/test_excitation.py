"""Excitation moves all sticks at frequencies of their own, within limits, and begins and ends gently."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL, QUADROTOR, TYPES

from rcopterx.control.identification.excitation import FADE_S, TONES_HZ, Excitation, excitation_for

TIME_S = np.arange(0.0, 60.0, 0.02)


def test_no_frequency_excites_two_axes() -> None:
    tones = [hz for axis in TONES_HZ for hz in axis]
    assert len(set(np.round(tones, 6))) == len(tones)


def test_root_mean_square_is_the_amplitude() -> None:
    excitation = Excitation((0.1, 0.2, 0.03, 0.05), 60.0)
    middle = [excitation.at(time_s) for time_s in TIME_S if FADE_S < time_s < 42.0]
    assert np.std(middle, axis=0) == pytest.approx([0.1, 0.2, 0.03, 0.05], rel=0.1)


def test_neighbours_with_different_combs_are_uncorrelated() -> None:
    amplitude, times_s = (0.1, 0.1, 0.1, 0.1), np.arange(2.0, 62.0, 0.02)
    first, second = (
        np.array([Excitation(amplitude, 64.0, comb).at(time_s) for time_s in times_s]) for comb in (0, 2)
    )
    assert np.abs(np.corrcoef(first.T, second.T)[:4, 4:]).max() < 0.02


def test_axes_are_uncorrelated() -> None:
    excitation = Excitation((0.1, 0.1, 0.1, 0.1), 44.0)
    values = np.array([excitation.at(time_s) for time_s in np.arange(2.0, 42.0, 0.02)])
    correlation = np.corrcoef(values.T) - np.eye(4)
    assert np.abs(correlation).max() < 0.02


@given(st.floats(-10.0, 100.0))
def test_it_is_small_and_nothing_outside_its_time(time_s: float) -> None:
    value = Excitation((0.1, 0.1, 0.1, 0.1), 60.0).at(time_s)
    assert np.abs(value).max() < 0.5
    if not 0.0 <= time_s < 60.0:
        assert not value.any()


def test_it_fades_in_and_out() -> None:
    excitation = Excitation((0.1, 0.1, 0.1, 0.1), 60.0)
    assert np.abs(excitation.at(0.02)).max() < 0.01
    assert np.abs(excitation.at(59.98)).max() < 0.01


@pytest.mark.parametrize("kind", sorted(TYPES))
def test_every_type_is_excited_within_a_quarter_of_its_sticks(kind: str) -> None:
    model = TYPES[kind]
    amplitude = np.array(excitation_for(model, 60.0).amplitude)
    room = np.minimum(model.u_max - model.hover_input, model.hover_input - model.u_min)
    assert (amplitude > 0.0).all()
    assert (amplitude <= 0.25 * room).all()


def test_strength_scales_every_axis() -> None:
    whole, half = excitation_for(COAXIAL, 60.0), excitation_for(COAXIAL, 60.0, strength=0.5)
    assert np.array(half.amplitude) == pytest.approx(0.5 * np.array(whole.amplitude))


def test_senseless_excitations_are_refused() -> None:
    with pytest.raises(ValueError, match="amplitude"):
        Excitation((0.1, -0.1, 0.1, 0.1), 60.0)
    with pytest.raises(ValueError, match="duration_s: must be from 20"):
        excitation_for(QUADROTOR, 5.0)
    with pytest.raises(ValueError, match="comb: must be from 0 to 2"):
        excitation_for(QUADROTOR, 60.0, comb=3)
