"""Promises of the pilot: its commands are sound whatever it sees, its prediction is what will be."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flight import ExactEstimator, Lab, NotedController, Plant, assert_sound, measured, still

from agents.controllers.registry import available_controllers, build_controller
from agents.estimators.registry import available_estimators, build_estimator
from agents.formation import FormationOffset
from agents.guidance import Guidance, LeaderPlan, Link
from agents.interfaces import Measurement
from agents.phases import Event, Phase
from agents.pilot import BLIND_LIMIT_S, BRIDGE_STAGES, SPOOL_UP_S, Frame, Pilot
from agents.trajectory import hold
from vehicles.model import Model
from vehicles.state import U_THRUST
from vehicles.types import COAXIAL, QUADROTOR

HOVER = COAXIAL.hover_input
UP = (0.1, -0.2, 1.0)


def seen(frame: int, position_m: tuple[float, float, float] = UP, period_s: float = 0.02) -> Frame:
    return Frame(1, frame, period_s, Measurement(np.array(position_m), 0.0))


def unseen(frame: int) -> Frame:
    return Frame(1, frame, 0.02, None)


def noted(model: Model = COAXIAL, inputs: np.ndarray | None = None, links: tuple[Link, ...] = ()) -> Pilot:
    inputs = model.hover_input[None, :] if inputs is None else inputs
    return Pilot(model, NotedController(inputs), ExactEstimator(model), Guidance(links))


def airborne(pilot: Pilot, frame: int = 0) -> Pilot:
    """A pilot that finds its vehicle in the air."""
    pilot.observe(seen(frame))
    pilot.note_applied("armed", -1, HOVER)
    assert pilot.guidance.phase is Phase.FLYING
    return pilot


def controller_of(pilot: Pilot) -> NotedController:
    assert isinstance(pilot.controller, NotedController)
    return pilot.controller


def real(controller: str, estimator: str, model: Model = COAXIAL, horizon: int = 15) -> Pilot:
    return Pilot(
        model,
        build_controller(controller, model, 0.02, {"horizon": horizon}),
        build_estimator(estimator, model, 0.02, {}),
        Guidance(),
    )


@settings(max_examples=30, deadline=None)
@given(
    delay_s=st.sampled_from([0.0, 0.02, 0.04, 0.047, 0.005, 0.1]),
    rate=st.sampled_from([(0.02, 1), (0.01, 2), (0.005, 4)]),
    model=st.sampled_from([COAXIAL, QUADROTOR]),
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
        pilot.observe(Frame(1, frame, period_s, measurement))
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
    model = COAXIAL
    pilot, plant = noted(model), Plant(model, still(UP), floor_m=None, acting=HOVER)
    pilot.observe(seen(0))
    pilot.note_applied("armed", -1, model.hover_input)
    for frame in range(40):
        if frame in (10, 11, 12, 25):
            assert pilot.coast()
        else:
            pilot.observe(Frame(1, frame, 0.02, measured(plant.state)))
        assert pilot.clock.current_frame == frame
        assert pilot.estimate.motion == pytest.approx(plant.state.motion, abs=1e-6)
        flight = pilot.control({})
        plant.send(flight.input)
        plant.advance(0.02)
    assert pilot.fallbacks["coasted"] == 4


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
    assert pilot.fallbacks["occluded"] == 19
    assert not pilot.ready


def test_after_blind_flight_the_estimator_starts_anew_where_the_vehicle_is_seen() -> None:
    pilot = airborne(noted())
    for frame in range(1, 20):
        pilot.observe(unseen(frame))
    pilot.observe(seen(20, (0.9, 0.9, 0.5)))
    assert pilot.estimate.motion[:3] == pytest.approx([0.9, 0.9, 0.5])


def test_a_refused_pose_is_counted_as_blind_flight() -> None:
    class Distrustful(ExactEstimator):
        def correct(self, measurement: Measurement) -> bool:
            return False

    pilot = airborne(Pilot(COAXIAL, NotedController(HOVER[None, :]), Distrustful(), Guidance()))
    for frame in range(1, 4):
        assert pilot.observe(seen(frame))
    assert pilot.fallbacks["gated_pose"] == 3


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


def test_on_the_floor_the_rotor_stays_off_and_the_controller_is_not_asked() -> None:
    pilot = noted()
    for frame, state in enumerate(["disarmed", "armed", "armed", "killed", "disarmed"]):
        pilot.observe(seen(frame, (0.0, 0.0, 0.0)))
        pilot.note_applied(state, pilot.sequence, np.zeros(4))
        flight = pilot.control({})
        assert not flight.input.any()
        assert flight.next_inputs.shape == (0, 4)
        assert flight.reference is None
    assert controller_of(pilot).asked == []


def test_take_off_turns_the_rotor_up_open_loop_and_then_resets_the_controller() -> None:
    pilot = noted()
    pilot.observe(seen(0, (0.0, 0.0, 0.0)))
    pilot.note_applied("armed", 0, np.zeros(4))
    assert pilot.take_off(1.0) is None
    thrusts = []
    for frame in range(1, round(SPOOL_UP_S / 0.02) + 3):
        thrusts.append(pilot.control({}).input[U_THRUST])
        pilot.observe(seen(frame, (0.0, 0.0, 0.0)))
    spooling = thrusts[: round(SPOOL_UP_S / 0.02)]
    assert spooling == sorted(spooling)
    assert max(spooling) < HOVER[U_THRUST]
    assert len(controller_of(pilot).resets) == 1
    (_, last_input) = controller_of(pilot).resets[0]
    assert last_input[U_THRUST] == pytest.approx(spooling[-1])


def test_an_agent_that_restarts_in_the_air_takes_over_without_a_kick() -> None:
    pilot = noted()
    pilot.observe(seen(100))
    assert not pilot.informed
    applied = np.array([0.1, -0.1, 0.5, 0.05])
    pilot.note_applied("armed", -7, applied)
    assert pilot.guidance.phase is Phase.FLYING
    assert pilot.informed
    pilot.control({})
    ((estimate, last_input),) = controller_of(pilot).resets
    assert last_input == pytest.approx(applied)
    assert estimate.motion[0] == pytest.approx(UP[0], abs=0.05)
    _, reference, _ = controller_of(pilot).asked[0]
    assert reference.position_m[0] == pytest.approx(UP)


@pytest.mark.parametrize(
    ("state", "thrust", "phase"),
    [
        ("armed", 0.0, Phase.ARMED),
        ("armed", 0.5, Phase.FLYING),
        ("hold", 0.5, Phase.FLYING),
        ("descend", 0.5, Phase.FLYING),
        ("descend", 0.1, Phase.GROUND),
        ("disarmed", 0.5, Phase.GROUND),
        ("cut", 0.5, Phase.GROUND),
        ("killed", 0.5, Phase.GROUND),
    ],
)
def test_a_new_agent_finds_out_whether_its_vehicle_is_in_the_air(
    state: str, thrust: float, phase: Phase
) -> None:
    pilot = noted()
    pilot.observe(seen(0))
    pilot.note_applied(state, -1, np.array([0.0, 0.0, thrust, 0.0]))
    assert pilot.guidance.phase is phase


def test_thrust_seen_later_does_not_put_a_vehicle_into_the_air() -> None:
    pilot = noted()
    pilot.observe(seen(0, (0.0, 0.0, 0.0)))
    pilot.note_applied("disarmed", -1, np.zeros(4))
    pilot.note_applied("armed", -1, HOVER)
    assert pilot.guidance.phase is Phase.ARMED


def test_the_gateway_decides_and_the_pilot_follows() -> None:
    pilot = airborne(noted())
    pilot.note_applied("hold", 0, HOVER)
    assert pilot.guidance.phase is Phase.EMERGENCY
    pilot.note_applied("armed", 0, HOVER)
    assert pilot.guidance.phase is Phase.FLYING
    pilot.note_applied("cut", 0, np.zeros(4))
    assert pilot.guidance.phase is Phase.GROUND
    assert not pilot.control({}).input.any()


def test_a_landing_goes_on_after_the_gateway_has_held_the_vehicle() -> None:
    pilot = airborne(noted())
    assert pilot.guidance.land(pilot.estimate, pilot.clock.time_s) is None
    for state in ("hold", "descend", "hold"):
        pilot.note_applied(state, 0, HOVER)
        assert pilot.guidance.phase is Phase.EMERGENCY
    pilot.note_applied("armed", 0, HOVER)
    assert pilot.guidance.phase is Phase.LANDING
    pilot.note_applied("armed", 0, HOVER)
    assert pilot.guidance.phase is Phase.LANDING


def test_who_was_held_while_it_flew_flies_on_even_if_it_landed_before() -> None:
    pilot = airborne(noted())
    pilot.guidance.land(pilot.estimate, pilot.clock.time_s)
    pilot.note_applied("hold", 0, HOVER)
    pilot.note_applied("cut", 0, np.zeros(4))
    assert pilot.guidance.phase is Phase.GROUND
    pilot.guidance.on_event(Event.RESUME, pilot.estimate)
    pilot.note_applied("hold", 0, HOVER)
    pilot.note_applied("armed", 0, HOVER)
    assert pilot.guidance.phase is Phase.FLYING


def test_the_next_inputs_are_those_after_the_command() -> None:
    inputs = np.linspace(0.3, 0.6, 12)[:, None] * np.array([0.1, 0.1, 1.0, 0.1])
    pilot = airborne(noted(inputs=inputs))
    flight = pilot.control({})
    assert flight.input == pytest.approx(inputs[0])
    assert flight.next_inputs == pytest.approx(inputs[1 : 1 + BRIDGE_STAGES])
    assert flight.start_s == COAXIAL.delay_s


def test_every_fallback_of_the_controller_is_counted_by_kind() -> None:
    pilot = airborne(noted())
    for kind in ("early_stop", "shifted_plan", "early_stop", None):
        controller_of(pilot).fallback = kind
        pilot.control({})
    assert pilot.fallbacks == {"early_stop": 2, "shifted_plan": 1}


def test_a_follower_without_plans_holds_its_place_and_counts_it() -> None:
    pilot = airborne(noted(links=(Link("h1", FormationOffset(np.array([1.0, 0.0, 0.0]))),)))
    flight = pilot.control({})
    assert flight.reference == pytest.approx([*UP, 0.0])
    assert pilot.guidance.events["no_leader_plan"] == 1


PAIRS = [
    *((controller, "extended_kalman") for controller in available_controllers()),
    *(("cascade", estimator) for estimator in available_estimators() if estimator != "extended_kalman"),
]


@pytest.mark.parametrize(("controller", "estimator"), PAIRS)
def test_every_controller_and_estimator_takes_off_flies_and_lands(controller: str, estimator: str) -> None:
    pilot, plant = real(controller, estimator), Plant()
    lab = Lab(pilot, plant)
    pilot.observe(seen(-1, (0.0, 0.0, 0.0)))
    pilot.note_applied("armed", 0, np.zeros(4))
    assert pilot.take_off(0.8) is None
    lab.run(4.0)
    assert pilot.guidance.phase is Phase.FLYING
    assert plant.state.motion[2] == pytest.approx(0.8, abs=0.2)
    assert pilot.guidance.go_to(np.array([0.3, -0.2, 1.0]), 0.8) is None
    lab.run(6.0)
    assert plant.state.motion[:4] == pytest.approx([0.3, -0.2, 1.0, 0.8], abs=0.1)
    assert pilot.guidance.land(pilot.estimate, pilot.clock.time_s) is None
    lab.run(7.0)
    assert pilot.guidance.phase is Phase.ARMED
    assert plant.on_floor
    assert not lab.flights[-1].input.any()


@pytest.mark.parametrize("controller", available_controllers())
def test_a_vehicle_goes_on_flying_when_its_agent_is_replaced(controller: str) -> None:
    plant = Plant(start=still((0.0, 0.0, 0.8)))
    first = Lab(real(controller, "extended_kalman"), plant)
    first.pilot.observe(seen(-1, (0.0, 0.0, 0.8)))
    first.pilot.note_applied("armed", -1, HOVER)
    first.run(8.0)
    second = Lab(real(controller, "extended_kalman"), plant)
    second.frame = first.frame
    second.pilot.observe(Frame(1, first.frame - 1, 0.02, measured(plant.state)))
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
    pilot.guidance.links = (Link("h1", FormationOffset(np.array([0.5, 0.0, 0.0]), 0.3, "heading")),)
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
            pilot.guidance.go_to(np.array([100.0, -100.0, 50.0]), -1e6)
        elif step == "lead":
            pilot.guidance.lead(pilot.estimate)
        elif isinstance(step[0], str):
            pilot.note_applied(step[0], pilot.sequence + step[1], np.array(step[2]))
        elif len(step) == 3:
            epoch, ahead, pose = step
            frame += ahead
            measurement = None if pose is None else Measurement(np.array(pose[0]), pose[1])
            pilot.observe(Frame(epoch, frame, 0.02, measurement))
        else:
            trajectory = hold(np.array(step[0]), step[1], 0.02, 30)
            heard["h1"] = LeaderPlan(trajectory, step[2], step[3])
        flight = pilot.control(heard)
        assert_sound(flight, pilot.model)
        if pilot.guidance.phase in (Phase.GROUND, Phase.ARMED):
            assert not flight.input.any()


def test_events_before_the_first_pose_change_nothing() -> None:
    pilot = noted()
    pilot.note_applied("armed", 0, np.zeros(4))
    assert pilot.guidance.phase is Phase.GROUND
    pilot.guidance.on_event(Event.TAKE_OFF, None)
    assert pilot.guidance.phase is Phase.GROUND
