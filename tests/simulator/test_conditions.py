"""Promises of the laboratory's conditions."""

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.conditions import LABORATORY

from rcopterx.simulator.conditions import Conditions


def test_laboratory_has_the_numbers_that_results_are_stated_for() -> None:
    assert LABORATORY.turbulence_rms == (0.15, 0.15, 0.1, 0.5)
    assert LABORATORY.turbulence_correlation_s == 0.5
    assert (LABORATORY.lag_mismatch, LABORATORY.parameter_mismatch) == (0.25, 0.08)
    assert (LABORATORY.position_noise_m, LABORATORY.angle_noise_rad) == (0.0003, 0.002)
    assert LABORATORY.trim_offset == 0.02


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("substep_s", 0.005),
        ("substep_s", 0.0),
        ("parameter_mismatch", -0.1),
        ("lag_mismatch", 1.0),
        ("position_noise_m", math.nan),
        ("transport_delay_s", math.inf),
        ("turbulence_rms", (0.1, 0.1, -0.1, 0.1)),
        ("coaxial_plant", "airship"),
        ("attitude_plant", "balloon"),
        ("downwash_m_s2", -1.0),
        ("volume_max_m", (1.0, 1.0, -2.0)),
    ],
)
def test_wrong_values_are_refused_with_the_name_of_the_field(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"^{field}"):
        replace(LABORATORY, **{field: value})


@given(st.floats())
def test_no_number_makes_conditions_non_finite(value: float) -> None:
    try:
        conditions = Conditions(battery_sag=value)
    except ValueError:
        return
    assert 0.0 <= conditions.battery_sag <= 0.9
