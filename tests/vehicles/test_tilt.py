"""Promises of the tilt models: unit gain, the modes of the Bell-Hiller rotor head, no preferred direction."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL

from rcopterx.vehicles.state import heading_matrix
from rcopterx.vehicles.tilt import TiltModel

BAR = COAXIAL.tilt
assert BAR is not None

bars = st.builds(
    TiltModel,
    frequency_rad_s=st.floats(5.0, 30.0),
    damping_ratio=st.floats(0.05, 1.0),
    servo_lag_s=st.floats(0.01, 0.05),
    bar_time_constant_s=st.floats(0.5, 3.0),
    upper_phase_rad=st.floats(-0.4, 0.4),
    lower_phase_rad=st.floats(-0.4, 0.4),
    upper_share=st.floats(0.0, 0.4),
    direct_m=st.floats(0.0, 0.02),
)
plain = st.builds(TiltModel, frequency_rad_s=st.floats(5.0, 30.0), damping_ratio=st.floats(0.05, 1.0))


@given(plain)
def test_a_constant_demand_becomes_that_acceleration(model: TiltModel) -> None:
    d = model.dynamics()
    steady = d.d - d.c @ np.linalg.solve(d.a, d.b)
    assert steady == pytest.approx(np.eye(2))


@given(bars)
def test_with_a_still_bar_the_gain_is_one_in_some_direction(model: TiltModel) -> None:
    d = model.dynamics()
    still = slice(0, 4)
    steady = d.d - d.c[:, still] @ np.linalg.solve(d.a[still, still], d.b[still])
    assert steady @ steady.T == pytest.approx(np.eye(2), abs=1e-9)


@given(bars, st.floats(-4.0, 4.0))
def test_no_direction_is_preferred(model: TiltModel, yaw_rad: float) -> None:
    d = model.dynamics()
    turn = heading_matrix(yaw_rad)
    whole = np.kron(np.eye(d.size // 2), turn)
    assert whole @ d.a @ whole.T == pytest.approx(d.a)
    assert whole @ d.b @ turn.T == pytest.approx(d.b)
    assert turn @ d.c @ whole.T == pytest.approx(d.c)
    assert turn @ d.d @ turn.T == pytest.approx(d.d)


def test_the_fast_mode_is_a_lightly_damped_oscillator_and_the_bar_lets_the_tilt_creep() -> None:
    modes = np.linalg.eigvals(replace(BAR, damping_ratio=1e-6).dynamics().a)
    fast = modes[np.abs(modes) > 5.0]
    assert np.abs(fast) == pytest.approx(np.full(4, BAR.frequency_rad_s), rel=0.02)
    assert np.abs(fast.real / np.abs(fast)).max() < 0.1
    creep = modes[np.abs(modes) < 1e-6]
    assert len(creep) == 2


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"frequency_rad_s": 0.0}, "frequency_rad_s: must be above 0"),
        ({"damping_ratio": -0.1}, "damping_ratio: must not be below 0"),
        ({"servo_lag_s": math.nan}, "servo_lag_s: must be finite"),
        ({"bar_time_constant_s": 0.0}, "bar_time_constant_s: must be above 0"),
        ({"upper_share": 1.0}, "upper_share: must be below 1"),
    ],
)
def test_a_vehicle_that_cannot_be_is_refused_by_its_field(change: dict[str, float], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        replace(BAR, **change)
