"""Promises of the lift-off: thrust that rises steadily to a limit, and an end whatever happens."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.vehicle_types import TYPES

from rcopterx.agents.flight.lift_off import LARGEST_SHARE, LIFTED_M, PATIENCE_S, LiftOff
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import MOTION_SIZE, U_THRUST

models = st.sampled_from(list(TYPES.values()))
times_s = st.floats(0.0, 1e4)


@given(models, times_s, st.lists(st.floats(0.0, 10.0), min_size=2, max_size=20))
def test_thrust_never_falls_and_keeps_its_limit(model: Model, begun_s: float, after_s: list[float]) -> None:
    lift_off = LiftOff(model)
    lift_off.begin(begun_s, 0.0)
    thrusts = [lift_off.thrust(begun_s + elapsed_s) for elapsed_s in sorted(after_s)]
    assert thrusts == sorted(thrusts)
    assert thrusts[0] >= 0.0
    assert thrusts[-1] <= min(LARGEST_SHARE * model.hover_input[U_THRUST], model.u_max[U_THRUST])


@given(models, times_s)
def test_what_acts_lags_behind_what_is_commanded(model: Model, begun_s: float) -> None:
    lift_off = LiftOff(model)
    lift_off.begin(begun_s, 0.0)
    acting = lift_off.estimate(np.zeros(MOTION_SIZE), begun_s + 1.0).actuator[U_THRUST]
    assert acting < lift_off.thrust(begun_s + 1.0)


@given(models, times_s, st.floats(-1.0, 1.0))
def test_it_is_seen_a_little_above_where_it_stood_and_nowhere_else(
    model: Model, begun_s: float, floor_m: float
) -> None:
    lift_off = LiftOff(model)
    assert not lift_off.lifted(floor_m + 1.0)
    lift_off.begin(begun_s, floor_m)
    assert not lift_off.lifted(floor_m + 0.5 * LIFTED_M)
    assert lift_off.lifted(floor_m + 2 * LIFTED_M)


@given(models, times_s)
def test_a_vehicle_that_stands_is_given_up_after_a_while(model: Model, begun_s: float) -> None:
    lift_off = LiftOff(model)
    assert not lift_off.failed(begun_s)
    lift_off.begin(begun_s, 0.0)
    assert not lift_off.failed(begun_s + PATIENCE_S)
    assert lift_off.failed(begun_s + 4.0)
    lift_off.end()
    assert not lift_off.failed(begun_s + 4.0)
    assert lift_off.thrust(begun_s + 4.0) == 0.0
