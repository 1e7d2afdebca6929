"""Promises of the pilot with real controllers: they fly, are replaced in flight, never command nonsense."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pilot_bench import HOVER, real, seen
from support.flight import Lab, Plant, assert_sound, measured, still

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.control.interfaces import Measurement
from rcopterx.control.plugins import CONTROLLERS, ESTIMATORS
from rcopterx.control.references.trajectory import hold
from rcopterx.formation.law import FollowedLeader, FormationOffset, LeaderPlan
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import YAW

PAIRS = [
    *((controller, "extended_kalman") for controller in CONTROLLERS.available()),
    *(("cascade", estimator) for estimator in ESTIMATORS.available() if estimator != "extended_kalman"),
]


@pytest.mark.parametrize(("controller", "estimator"), PAIRS)
def test_every_controller_and_estimator_takes_off_flies_and_lands(controller: str, estimator: str) -> None:
    pilot, plant = real(controller, estimator), Plant()
    lab = Lab(pilot, plant)
    pilot.observe(seen(-1, (0.0, 0.0, 0.0)))
    pilot.note_applied("armed", 0, np.zeros(4))
    assert pilot.take_off(0.8) is None
    while pilot.guidance.phase is not Phase.FLYING:
        lab.run(0.1)
        assert plant.time_s < 4.0
    assert plant.state.motion[2] == pytest.approx(0.8, abs=0.2)
    assert pilot.guidance.go_to(pilot.guidance.way_to(np.array([0.3, -0.2, 1.0]), 0.8)) is None
    lab.run(4.0)
    assert plant.state.motion[:4] == pytest.approx([0.3, -0.2, 1.0, 0.8], abs=0.1)
    assert pilot.guidance.land(pilot.estimate, pilot.clock.time_s) is None
    landing_s = plant.time_s
    while pilot.guidance.phase is not Phase.ARMED:
        lab.run(0.1)
        assert plant.time_s < landing_s + 7.0
    lab.run(0.5)
    assert plant.on_floor
    assert not lab.flights[-1].input.any()


@pytest.mark.parametrize("yaw_rad", [np.pi, -np.pi, 3.1])
def test_a_vehicle_that_looks_back_flies_without_a_whole_turn(yaw_rad: float) -> None:
    pilot, plant = real("cascade", "extended_kalman"), Plant(start=still((0.0, 0.0, 0.0), yaw_rad))
    lab = Lab(pilot, plant)
    pilot.observe(StampedMeasurement(1, -1, 0.02, measured(plant.state)))
    pilot.note_applied("armed", 0, np.zeros(4))
    assert pilot.take_off(0.8) is None
    lab.run(4.0)
    assert plant.state.motion[:4] == pytest.approx([0.0, 0.0, 0.8, yaw_rad], abs=0.1)
    for turn_rad in (0.1, -0.1):
        goal_rad = plant.state.motion[YAW] + turn_rad
        to_rad = pilot.estimate.motion[YAW] + turn_rad
        assert pilot.guidance.go_to(pilot.guidance.way_to(np.array([0.0, 0.0, 0.8]), to_rad)) is None
        lab.run(2.0)
        assert plant.state.motion[YAW] == pytest.approx(goal_rad, abs=0.05)


@pytest.mark.parametrize("controller", CONTROLLERS.available())
def test_a_vehicle_goes_on_flying_when_its_agent_is_replaced(controller: str) -> None:
    plant = Plant(start=still((0.0, 0.0, 0.8)))
    first = Lab(real(controller, "extended_kalman"), plant)
    first.pilot.observe(seen(-1, (0.0, 0.0, 0.8)))
    first.pilot.note_applied("armed", -1, HOVER)
    first.run(4.0)
    second = Lab(real(controller, "extended_kalman"), plant)
    second.frame = first.frame
    second.pilot.observe(StampedMeasurement(1, first.frame - 1, 0.02, measured(plant.state)))
    second.pilot.note_applied("armed", -1, first.flights[-1].input)
    before = plant.state.motion[:3].copy()
    for _ in range(100):
        second.tick()
        assert np.linalg.norm(plant.state.motion[:3] - before) < 0.01
    steps = np.diff([flight.input for flight in (first.flights[-1], *second.flights)], axis=0)
    assert np.abs(steps).max() < 0.02
    assert second.pilot.guidance.phase is Phase.FLYING


numbers = st.floats(-100, 100) | st.floats(-1.5, 1.5)
frames = st.builds(
    lambda epoch, step, position, yaw: (epoch, step, None if yaw is None else (position, yaw)),
    st.sampled_from([1, 1, 1, 1, 2]),
    st.integers(-2, 30),
    st.tuples(numbers, numbers, numbers),
    st.none() | numbers,
)
applied = st.tuples(
    st.sampled_from(["disarmed", "armed", "hold", "descend", "cut", "killed"]),
    st.integers(-3, 3),
    st.tuples(*[st.floats(-1, 1)] * 4),
)
plans = st.tuples(
    st.tuples(numbers, numbers, numbers), st.floats(-1e6, 1e6), st.floats(-1.0, 600.0), st.booleans()
)
requests = st.sampled_from(["take_off", "land", "go_to", "lead"])
steps = st.lists(st.one_of(frames, applied, plans, requests, st.just("coast")), max_size=40)


@pytest.mark.parametrize("controller", ["paper", "cascade", "lqr", "pid"])
@settings(max_examples=15, deadline=None)
@given(story=steps)
def test_commands_are_finite_and_within_the_limits_whatever_happens(
    controller: str, story: list[tuple | str]
) -> None:
    pilot = real(controller, "extended_kalman", horizon=8)
    pilot.guidance.follow_instead(
        [FollowedLeader("h1", FormationOffset(np.array([0.5, 0.0, 0.0]), 0.3, "heading"))]
    )
    heard: dict[str, LeaderPlan] = {}
    frame = 0
    for step in story:
        if step == "coast":
            pilot.coast()
        elif step == "take_off":
            pilot.take_off(1.0)
        elif step == "land":
            pilot.guidance.land(pilot.estimate, pilot.clock.time_s)
        elif step == "go_to":
            pilot.guidance.go_to(pilot.guidance.way_to(np.array([100.0, -100.0, 50.0]), -1e6))
        elif step == "lead":
            pilot.guidance.lead(pilot.estimate)
        elif isinstance(step[0], str):
            pilot.note_applied(step[0], pilot.sequence + step[1], np.array(step[2]))
        elif len(step) == 3:
            epoch, ahead, pose = step
            frame += ahead
            measurement = None if pose is None else Measurement(np.array(pose[0]), pose[1])
            pilot.observe(StampedMeasurement(epoch, frame, 0.02, measurement))
        else:
            trajectory = hold(np.array(step[0]), step[1], 0.02, 30)
            heard["h1"] = LeaderPlan(trajectory, step[2], step[3])
        flight = pilot.control(heard)
        assert_sound(flight, pilot.model)
        if pilot.guidance.phase in (Phase.GROUND, Phase.ARMED):
            assert not flight.input.any()
