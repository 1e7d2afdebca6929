"""Promises of the pilot's prediction: it is what will be, also when poses are late, missing or refused."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pilot_bench import HOVER, UP, airborne, controller_of, noted, seen, unseen
from support.flight import ExactEstimator, NotedController, Plant, measured, still
from support.vehicle_types import COAXIAL_LAG, QUADROTOR

from rcopterx.agents.estimation import BLIND_LIMIT_S, StampedMeasurement
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.pilot import Pilot
from rcopterx.control.interfaces import Measurement
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import inertial_velocity


@settings(max_examples=30, deadline=None)
@given(
    delay_s=st.sampled_from([0.0, 0.02, 0.04, 0.047, 0.005, 0.1]),
    rate=st.sampled_from([(0.02, 1), (0.01, 2), (0.005, 4)]),
    model=st.sampled_from([COAXIAL_LAG, QUADROTOR]),
    seed=st.integers(0, 2**32 - 1),
    occluded=st.sets(st.integers(5, 60), max_size=8),
)
def test_the_compensated_state_is_the_vehicles_state_when_the_command_begins_to_act(
    delay_s: float, rate: tuple[float, int], model: Model, seed: int, occluded: set[int]
) -> None:
    model = replace(model, delay_s=delay_s)
    pilot = noted(model, np.random.default_rng(seed).uniform(model.u_min, model.u_max, (50, 4)))
    period_s, per_tick = rate
    plant = Plant(model, still(UP), floor_m=None, acting=model.hover_input)
    pilot.observe(seen(0, UP, period_s))
    pilot.note_applied("armed", -1, model.hover_input)
    for frame in range(60):
        measurement = None if frame in occluded else measured(plant.state)
        pilot.observe(StampedMeasurement(1, frame, period_s, measurement))
        if frame % per_tick == 0:
            future = deepcopy(plant)
            future.advance(delay_s)
            flight = pilot.control({})
            asked, _, _ = controller_of(pilot).asked[-1]
            assert asked.motion == pytest.approx(future.state.motion, abs=1e-6)
            assert asked.actuator == pytest.approx(future.state.actuator, abs=1e-9)
            plant.send(flight.input)
            pilot.note_applied("armed", pilot.sequence, flight.input)
        plant.advance(period_s)


def test_the_prediction_uses_what_the_gateway_applied_not_what_was_sent() -> None:
    pilot = airborne(noted())
    pilot.control({})
    limited = np.array([0.0, 0.0, 0.2, 0.0])
    pilot.note_applied("armed", pilot.sequence, limited)
    pilot.observe(seen(1))
    pilot.control({})
    _, _, last = controller_of(pilot).asked[-1]
    assert last == pytest.approx(limited)


def test_missing_frames_are_bridged_by_prediction_and_a_resuming_tracker_costs_no_time_twice() -> None:
    model = COAXIAL_LAG
    pilot, plant = noted(model), Plant(model, still(UP), floor_m=None, acting=HOVER)
    pilot.observe(seen(0))
    pilot.note_applied("armed", -1, model.hover_input)
    for frame in range(40):
        if frame in (10, 11, 12, 25):
            assert pilot.coast()
        else:
            pilot.observe(StampedMeasurement(1, frame, 0.02, measured(plant.state)))
        assert pilot.clock.current_frame == frame
        assert pilot.estimate.motion == pytest.approx(plant.state.motion, abs=1e-6)
        flight = pilot.control({})
        plant.send(flight.input)
        plant.advance(0.02)
    assert pilot.events["pose_extrapolated"] == 4


def test_blind_flight_has_a_limit() -> None:
    pilot = airborne(noted())
    frames = round(BLIND_LIMIT_S / 0.02)
    assert [pilot.coast() for _ in range(frames + 5)] == [True] * (frames - 1) + [False] * 6
    assert not pilot.ready
    assert pilot.take_off(1.0) is not None
    pilot.observe(seen(frames + 10))
    assert pilot.ready


def test_occluded_frames_are_counted_and_blind_flight_ends_with_them_too() -> None:
    pilot = airborne(noted())
    for frame in range(1, 20):
        pilot.observe(unseen(frame))
    assert pilot.events["occluded"] == 19
    assert not pilot.ready


def test_after_blind_flight_the_estimator_starts_anew_where_the_vehicle_is_seen() -> None:
    pilot = airborne(noted())
    for frame in range(1, 20):
        pilot.observe(unseen(frame))
    pilot.observe(seen(20, (0.9, 0.9, 0.5)))
    assert pilot.estimate.motion[:3] == pytest.approx([0.9, 0.9, 0.5])


def test_after_a_pause_of_the_process_the_estimator_starts_anew_where_the_vehicle_is_seen() -> None:
    pilot = airborne(noted())
    pilot.observe(seen(1))
    pilot.observe(seen(1 + round(BLIND_LIMIT_S / 0.02) + 2, (0.9, 0.9, 0.5)))
    assert pilot.estimate.motion[:3] == pytest.approx([0.9, 0.9, 0.5])


def test_after_blind_flight_the_estimator_starts_with_the_mean_velocity_meanwhile() -> None:
    pilot = airborne(noted())
    x, y, z = UP
    pilot.observe(seen(25, (x + 0.25, y, z - 0.75)))
    assert inertial_velocity(pilot.estimate.motion) == pytest.approx([0.25 / 0.48, 0.0, -0.75 / 0.48])


def test_after_a_rejected_pose_and_blind_flight_the_estimator_starts_at_rest() -> None:
    class Strict(ExactEstimator):
        def correct(self, measurement: Measurement) -> bool:
            return False

    pilot = airborne(Pilot(COAXIAL_LAG, NotedController(HOVER[None, :]), Strict(COAXIAL_LAG), Guidance()))
    x, y, z = UP
    pilot.observe(seen(1, (x + 1.0, y, z)))
    pilot.observe(seen(25, UP))
    assert inertial_velocity(pilot.estimate.motion) == pytest.approx([0.0, 0.0, 0.0])


def test_the_prediction_uses_what_the_gateway_flies_while_it_overrides_the_agent() -> None:
    pilot = airborne(noted(inputs=np.array([[0.0, 0.0, 1.0, 0.0]])))
    sinking = np.array([0.0, 0.0, 0.4, 0.0])
    pilot.control({})
    pilot.note_applied("land", 0, sinking)
    pilot.observe(seen(1))
    pilot.control({})
    _, _, last = controller_of(pilot).asked[-1]
    assert last == pytest.approx(sinking)


def test_a_refused_pose_is_counted_as_blind_flight() -> None:
    class Distrustful(ExactEstimator):
        def correct(self, measurement: Measurement) -> bool:
            return False

    pilot = airborne(Pilot(COAXIAL_LAG, NotedController(HOVER[None, :]), Distrustful(), Guidance()))
    for frame in range(1, 4):
        assert pilot.observe(seen(frame))
    assert pilot.events["gated_pose"] == 3


def test_refused_poses_are_not_believed_by_the_pilot_however_long_they_go_on() -> None:
    class Distrustful(ExactEstimator):
        def correct(self, measurement: Measurement) -> bool:
            return False

    pilot = airborne(Pilot(COAXIAL_LAG, NotedController(HOVER[None, :]), Distrustful(), Guidance()))
    frames = round(2 * BLIND_LIMIT_S / 0.02)
    for frame in range(1, frames):
        pilot.observe(seen(frame, (9.0, 9.0, 9.0)))
    assert not pilot.ready
    assert abs(pilot.estimate.motion[0]) < 1.0


@pytest.mark.parametrize("frame", [5, 4, 0])
def test_old_frames_are_refused(frame: int) -> None:
    pilot = airborne(noted(), frame=5)
    before = pilot.estimate
    assert not pilot.observe(seen(frame, (9.0, 9.0, 9.0)))
    assert pilot.estimate is before


def test_an_occluded_vehicle_that_was_never_seen_starts_nothing() -> None:
    pilot = noted()
    assert not pilot.observe(unseen(0))
    assert not pilot.coast()
    assert pilot.take_off(1.0) == "no pose yet"
    pilot.note_applied("armed", 0, HOVER)
    assert pilot.guidance.phase is Phase.GROUND
    assert not pilot.informed


def test_a_standing_vehicle_that_is_not_seen_does_not_fall_through_the_floor() -> None:
    pilot = noted()
    pilot.observe(seen(0, (0.1, 0.2, 0.05)))
    pilot.note_applied("disarmed", 0, np.zeros(4))
    for frame in range(1, 500):
        pilot.observe(unseen(frame))
        flight = pilot.control({})
    assert pilot.estimate.motion[:3] == pytest.approx([0.1, 0.2, 0.05])
    assert flight.plan.position_m[-1] == pytest.approx([0.1, 0.2, 0.05])
