"""Promises of the downwash between vehicles."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.vehicle_types import COAXIAL, TYPES

from rcopterx.simulator.conditions import HELICOPTER, IDEAL
from rcopterx.simulator.laboratory import Laboratory, downwash_m_s2
from rcopterx.simulator.plant import Pose


def test_downwash_is_full_close_below_and_falls_with_the_distance_and_to_the_sides() -> None:
    assert downwash_m_s2(0.1, 0.0, 1.0) == downwash_m_s2(0.3, 0.0, 1.0) == 1.0
    assert downwash_m_s2(0.6, 0.0, 1.0) == pytest.approx(0.5)
    assert downwash_m_s2(0.3, 0.15, 1.0) == pytest.approx(math.exp(-1))


@given(st.floats(-3, 3), st.floats(0, 3), st.floats(0, 3))
def test_downwash_never_lifts_nor_exceeds_its_strength(below: float, aside: float, strength: float) -> None:
    assert 0.0 <= downwash_m_s2(below, aside, strength) <= strength
    assert below > 0.0 or downwash_m_s2(below, aside, strength) == 0.0


@pytest.mark.parametrize("kind", TYPES)
def test_vehicle_below_another_is_pushed_down_and_the_upper_one_not(kind: str) -> None:
    model = TYPES[kind]
    windless = replace(
        HELICOPTER, turbulence_rms=(0.0, 0.0, 0.0, 0.0), parameter_mismatch=0.0, trim_offset=0.0
    )
    start = {"above": Pose((0.0, 0.0, 1.5)), "below": Pose((0.05, 0.0, 1.1)), "aside": Pose((1.0, 0.0, 1.1))}
    lab = Laboratory(dict.fromkeys(start, model), start, windless)
    for name in start:
        lab.plants[name].set_input(model.hover_input)
    for _ in range(10):
        lab.advance(0.02)
    climb = {name: lab.plants[name].motion[6] for name in start}
    assert climb["aside"] - climb["below"] == pytest.approx(0.2 * 0.75 * math.exp(-1 / 9), rel=0.05)
    assert climb["above"] == pytest.approx(climb["aside"], abs=1e-3)


def test_vehicle_that_stands_or_that_the_conditions_leave_alone_feels_none() -> None:
    start = {"above": Pose((0.0, 0.0, 1.5)), "below": Pose((0.0, 0.0, 1.2))}
    lab = Laboratory(dict.fromkeys(start, COAXIAL), start, replace(IDEAL, coaxial_plant="helicopter"))
    lab.advance(0.1)
    assert lab.plants["below"].downwash_m_s2 == 0.0
    lab = Laboratory(dict.fromkeys(start, COAXIAL), {**start, "above": Pose((0.0, 0.0, 0.0))}, HELICOPTER)
    lab.advance(0.1)
    assert lab.plants["below"].downwash_m_s2 == 0.0
