"""Promises of the downwash between vehicles."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.conditions import HELICOPTER, IDEAL
from support.vehicle_types import COAXIAL, TYPES

from rcopterx.simulator.laboratory import Laboratory, wake_below
from rcopterx.simulator.plant import STILL, BodyPose


def test_downwash_is_full_close_below_and_falls_with_the_distance_and_to_the_sides() -> None:
    assert wake_below(0.0, 0.0, 0.1, 1.0).down_m_s2 == wake_below(0.0, 0.0, 0.3, 1.0).down_m_s2 == 1.0
    assert wake_below(0.0, 0.0, 0.6, 1.0).down_m_s2 == pytest.approx(0.5)
    assert wake_below(0.0, 0.0, 0.02, 1.0).down_m_s2 == pytest.approx(0.2)
    assert wake_below(0.16, 0.0, 0.3, 1.0).down_m_s2 == pytest.approx(math.exp(-1))
    assert wake_below(0.3, 0.0, 1.0, 1.0).down_m_s2 == pytest.approx(0.3 * math.exp(-1))


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(0, 3))
def test_downwash_never_lifts_nor_exceeds_its_strength(x: float, y: float, below: float, most: float) -> None:
    wake = wake_below(x, y, below, most)
    assert 0.0 <= wake.down_m_s2 <= most
    assert below > 0.0 or wake == STILL


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.1, 2.0))
def test_slopes_are_those_of_the_downwash(x: float, y: float, below: float) -> None:
    def down(x: float, y: float) -> float:
        return wake_below(x, y, below, 2.5).down_m_s2

    wake, step = wake_below(x, y, below, 2.5), 1e-5
    along = (down(x + step, y) - down(x - step, y)) / (2 * step)
    across = (down(x, y + step) - down(x, y - step)) / (2 * step)
    assert (wake.slope_x_per_s2, wake.slope_y_per_s2) == pytest.approx((along, across), abs=1e-4)


def test_a_helicopter_at_the_edge_of_a_wake_tilts_towards_its_middle() -> None:
    start = {"above": BodyPose((0.0, 0.0, 1.5)), "below": BodyPose((-0.15, 0.1, 1.1))}
    lab = Laboratory(
        dict.fromkeys(start, COAXIAL), start, replace(IDEAL, coaxial_plant="helicopter", downwash_m_s2=2.5)
    )
    lab.advance(0.06)
    tilted = lab.plants["below"].pose
    assert tilted.pitch_rad > 0.002, "forward"
    assert tilted.roll_rad > 0.001, "to the right"


@pytest.mark.parametrize("kind", TYPES)
def test_vehicle_below_another_is_pushed_down_and_the_upper_one_not(kind: str) -> None:
    model = TYPES[kind]
    windless = replace(
        HELICOPTER, turbulence_rms=(0.0, 0.0, 0.0, 0.0), parameter_mismatch=0.0, trim_offset=0.0
    )
    start = {
        "above": BodyPose((0.0, 0.0, 1.5)),
        "below": BodyPose((0.05, 0.0, 1.1)),
        "aside": BodyPose((1.0, 0.0, 1.1)),
    }
    lab = Laboratory(dict.fromkeys(start, model), start, windless)
    for name in start:
        lab.plants[name].set_input(model.hover_input)
    for _ in range(10):
        lab.advance(0.02)
    climb = {name: lab.plants[name].motion[6] for name in start}
    assert climb["aside"] - climb["below"] == pytest.approx(
        0.2 * 2.5 * 0.75 * math.exp(-((0.05 / 0.18) ** 2)), rel=0.05
    )
    assert climb["above"] == pytest.approx(climb["aside"], abs=1e-3)


def test_vehicle_that_stands_or_that_the_conditions_leave_alone_feels_none() -> None:
    start = {"above": BodyPose((0.0, 0.0, 1.5)), "below": BodyPose((0.0, 0.0, 1.2))}
    lab = Laboratory(dict.fromkeys(start, COAXIAL), start, replace(IDEAL, coaxial_plant="helicopter"))
    lab.advance(0.1)
    assert lab.plants["below"].wake == STILL
    lab = Laboratory(dict.fromkeys(start, COAXIAL), {**start, "above": BodyPose((0.0, 0.0, 0.0))}, HELICOPTER)
    lab.advance(0.1)
    assert lab.plants["below"].wake == STILL
