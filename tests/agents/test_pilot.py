"""Promises of the pilot: when the rotor turns, when its controller is called, what its commands contain."""

from dataclasses import replace

import numpy as np
import pytest
from pilot_bench import HOVER, UP, airborne, controller_of, noted, seen
from support.flight import ExactEstimator, NotedController
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.flight.lift_off import LIFTED_M, SPOOL_UP_S
from rcopterx.agents.flight.timeline import INPUT_UNIT
from rcopterx.agents.guards.step_guard import BRIDGED_S
from rcopterx.agents.pilot import Pilot
from rcopterx.bus.message import SHORTEST_PERIOD_S
from rcopterx.bus.messages import MAX_NEXT_INPUTS
from rcopterx.control.identification.excitation import Excitation
from rcopterx.formation.law import FollowedLeader, FormationOffset
from rcopterx.vehicles.lift_off import RESTING_SHARE
from rcopterx.vehicles.phases import Event, Phase
from rcopterx.vehicles.state import U_THRUST


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


RISING_FRAMES = 7  # in which the thrust of a pulse rises


def taking_off() -> Pilot:
    pilot = noted()
    pilot.observe(seen(0, (0.0, 0.0, 0.0)))
    pilot.note_applied("armed", 0, np.zeros(4))
    assert pilot.take_off(1.0) is None
    return pilot


def test_take_off_turns_the_rotor_up_open_loop_until_the_vehicle_lifts() -> None:
    pilot = taking_off()
    thrusts = []
    frames = round(SPOOL_UP_S / 0.02) + RISING_FRAMES
    for frame in range(1, frames):
        thrusts.append(pilot.control({}).input[U_THRUST])
        pilot.observe(seen(frame, (0.0, 0.0, 0.0)))
    assert thrusts[round(SPOOL_UP_S / 0.02) :] == sorted(thrusts[round(SPOOL_UP_S / 0.02) :])
    assert thrusts[round(0.8 * SPOOL_UP_S / 0.02)] < HOVER[U_THRUST] < thrusts[-1]
    assert not controller_of(pilot).resets
    pilot.observe(seen(frames, (0.0, 0.0, 1.1 * LIFTED_M)))
    pilot.control({})
    ((estimate, last_input),) = controller_of(pilot).resets
    # What lifted the vehicle carries its weight: no kick by a hover thrust that is only believed.
    carries_m_s2 = pilot.model.gravity_m_s2 - estimate.disturbance[U_THRUST]
    assert last_input[U_THRUST] == pytest.approx(carries_m_s2 / pilot.model.b[U_THRUST])
    acts_m_s2 = pilot.model.b[U_THRUST] * estimate.actuator[U_THRUST]
    assert 0.0 < acts_m_s2 - carries_m_s2 < 0.5 * pilot.model.gravity_m_s2
    assert pilot.guidance.set_point()[0][2] == pytest.approx(1.0)


def test_a_model_changed_while_the_rotor_turns_up_lifts_the_vehicle_next_time() -> None:
    pilot = taking_off()
    heavy = replace(COAXIAL_LAG, gravity_m_s2=1.2 * COAXIAL_LAG.gravity_m_s2)
    pilot.use_model(heavy, controller_of(pilot), ExactEstimator(heavy))
    pilot.note_applied("disarmed", 0, np.zeros(4))
    pilot.control({})
    pilot.note_applied("armed", 0, np.zeros(4))
    assert pilot.take_off(1.0) is None
    for frame in range(1, 1 + round(SPOOL_UP_S / 0.02)):
        pilot.observe(seen(frame, (0.0, 0.0, 0.0)))
    thrust = pilot.control({}).input[U_THRUST]
    assert thrust == pytest.approx(RESTING_SHARE * heavy.hover_input[U_THRUST], rel=0.05)


def test_while_the_rotor_turns_up_the_next_inputs_are_those_that_would_follow() -> None:
    pilot = taking_off()
    flight = pilot.control({})
    assert len(flight.next_inputs) == round(BRIDGED_S / 0.02)
    followed = []
    for frame in range(1, 1 + len(flight.next_inputs)):
        pilot.observe(seen(frame, (0.0, 0.0, 0.0)))
        if frame % 2:
            pilot.fly_as_planned()
            followed.append(pilot.input_history.newest)
        else:
            followed.append(pilot.control({}).input)
    assert np.array(followed) == pytest.approx(flight.next_inputs)


def test_a_vehicle_that_does_not_lift_is_given_up_with_its_rotor_off() -> None:
    pilot = taking_off()
    for frame in range(1, 400):
        flight = pilot.control({})
        pilot.observe(seen(frame, (0.0, 0.0, 0.0)))
    assert pilot.guidance.phase is Phase.ARMED
    assert pilot.events["not_lifted"] == 1
    assert not flight.input.any()
    assert not controller_of(pilot).resets


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


def test_a_take_off_goes_on_to_its_height_after_the_gateway_has_held_the_vehicle() -> None:
    pilot = airborne(noted())
    guidance = pilot.guidance
    guidance.on_event(Event.DISARM, pilot.estimate, pilot.clock.time_s)
    guidance.on_event(Event.ARM, pilot.estimate, pilot.clock.time_s)
    assert guidance.take_off(pilot.estimate, 0.7, pilot.clock.time_s) is None
    end_m, _ = guidance.set_point()
    for state in ("hold", "descend", "hold"):
        pilot.note_applied(state, 0, HOVER)
        assert guidance.phase is Phase.EMERGENCY
    pilot.note_applied("armed", 0, HOVER)
    assert guidance.phase is Phase.TAKEOFF
    assert guidance.set_point()[0] == pytest.approx(end_m)
    pilot.note_applied("armed", 0, HOVER)
    assert guidance.phase is Phase.TAKEOFF


def test_a_take_off_that_was_interrupted_and_ended_on_the_floor_is_forgotten() -> None:
    pilot = airborne(noted())
    pilot.guidance.on_event(Event.DISARM, pilot.estimate, pilot.clock.time_s)
    pilot.guidance.on_event(Event.ARM, pilot.estimate, pilot.clock.time_s)
    pilot.guidance.take_off(pilot.estimate, 0.7, pilot.clock.time_s)
    pilot.note_applied("hold", 0, HOVER)
    pilot.note_applied("cut", 0, np.zeros(4))
    assert pilot.guidance.phase is Phase.GROUND
    pilot.guidance.on_event(Event.RESUME, pilot.estimate, pilot.clock.time_s)
    pilot.note_applied("armed", 0, HOVER)
    assert pilot.guidance.phase is Phase.FLYING


def test_who_was_held_while_it_flew_flies_on_even_if_it_landed_before() -> None:
    pilot = airborne(noted())
    pilot.guidance.land(pilot.estimate, pilot.clock.time_s)
    pilot.note_applied("hold", 0, HOVER)
    pilot.note_applied("cut", 0, np.zeros(4))
    assert pilot.guidance.phase is Phase.GROUND
    pilot.guidance.on_event(Event.RESUME, pilot.estimate, pilot.clock.time_s)
    pilot.note_applied("hold", 0, HOVER)
    pilot.note_applied("armed", 0, HOVER)
    assert pilot.guidance.phase is Phase.FLYING


def test_the_next_inputs_are_those_after_the_command() -> None:
    inputs = np.linspace(0.3, 0.6, 12)[:, None] * np.array([0.1, 0.1, 1.0, 0.1])
    controller = NotedController(inputs, horizon=12)
    pilot = airborne(Pilot(COAXIAL_LAG, controller, ExactEstimator(), Guidance()))
    flight = pilot.control({})
    assert flight.input == pytest.approx(inputs[0], abs=INPUT_UNIT)
    assert flight.next_inputs == pytest.approx(inputs[1 : 1 + round(BRIDGED_S / 0.02)], abs=INPUT_UNIT)
    assert flight.start_s == COAXIAL_LAG.delay_s


@pytest.mark.parametrize("period_s", [SHORTEST_PERIOD_S, 0.0025, 0.005, 0.01, 0.02, 0.04])
def test_the_next_inputs_last_for_the_same_time_at_any_control_period_and_fit_into_a_command(
    period_s: float,
) -> None:
    controller = NotedController(HOVER[None, :], period_s, horizon=100)
    pilot = airborne(Pilot(COAXIAL_LAG, controller, ExactEstimator(), Guidance()))
    count = len(pilot.control({}).next_inputs)
    assert count * period_s == pytest.approx(BRIDGED_S, abs=period_s / 2 + 1e-9)
    assert count <= MAX_NEXT_INPUTS


def test_every_fallback_of_the_controller_is_counted_by_kind() -> None:
    pilot = airborne(noted())
    for kind in ("early_stop", "shifted_plan", "early_stop", None):
        controller_of(pilot).fallback = kind
        pilot.control({})
    assert pilot.events == {"early_stop": 2, "shifted_plan": 1}


def test_a_follower_without_plans_holds_its_place_and_counts_it() -> None:
    pilot = airborne(noted(links=(FollowedLeader("h1", FormationOffset(np.array([1.0, 0.0, 0.0]))),)))
    flight = pilot.control({})
    assert flight.reference == pytest.approx([*UP, 0.0])
    assert pilot.guidance.events["leader_plan_missing"] == 1


def test_events_before_the_first_pose_change_nothing() -> None:
    pilot = noted()
    pilot.note_applied("armed", 0, np.zeros(4))
    assert pilot.guidance.phase is Phase.GROUND
    pilot.guidance.on_event(Event.TAKE_OFF, pilot.estimate, pilot.clock.time_s)
    assert pilot.guidance.phase is Phase.GROUND


def test_an_excitation_moves_the_sticks_and_the_estimator_knows() -> None:
    pilot = airborne(noted())
    pilot.exciter.begin(Excitation((0.1, 0.1, 0.02, 0.05), 30.0), np.array(UP), 50.0, 0.0)
    largest = 0.0
    for frame in range(1, 200):
        pilot.observe(seen(frame))
        output = pilot.control({})
        assert (output.input <= pilot.model.u_max).all()
        assert (pilot.input_history.newest == output.input).all()
        largest = max(largest, float(np.abs(output.input - HOVER).max()))
    assert largest > 0.1


def test_an_excitation_ends_when_poses_are_missing() -> None:
    pilot = airborne(noted())
    pilot.exciter.begin(Excitation((0.1, 0.1, 0.02, 0.05), 30.0), np.array(UP), 0.3, 0.0)
    for _ in range(7):
        pilot.coast()
        pilot.control({})
    assert pilot.exciter.outcome.startswith("no pose for")
