"""The fit finds what a vehicle is, says how well it knows it, and refuses what a flight does not show."""

from dataclasses import replace

import numpy as np
import pytest
from support.simulated_flight import simulated_flight, still_flight
from support.vehicle_types import COAXIAL, COAXIAL_LAG, CRAZYFLIE, QUADROTOR

from rcopterx.control.controllers.cascade.weights import default_weights
from rcopterx.control.identification.excitation import Excitation, excitation_for
from rcopterx.control.identification.fit import identify
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.control.identification.result import HEADING, HEIGHT, HORIZONTAL, Identification
from rcopterx.vehicles.model import CALM, IDENTIFIED, Model
from rcopterx.vehicles.state import U_THRUST, U_YAW
from rcopterx.vehicles.tilt import TiltModel


def other_helicopter() -> Model:
    """A vehicle of the type that differs from its middle in everything."""
    assert COAXIAL.tilt is not None
    tilt = replace(
        COAXIAL.tilt, frequency_rad_s=10.0, damping_ratio=0.4, servo_lag_s=0.025, upper_phase_rad=-0.05
    )
    return replace(
        COAXIAL,
        input_gain=(2.4, 1.8, 16.5, 90.0),
        damping=(*COAXIAL.damping[:3], -4.2),
        lag_s=(*COAXIAL.lag_s[:2], 0.13, 0.14),
        delay_s=0.04,
        thrust_coupling=3.5,
        tilt=tilt,
    )


@pytest.fixture(scope="module")
def flight() -> FlightRecording:
    return simulated_flight(other_helicopter())


@pytest.fixture(scope="module")
def found(flight: FlightRecording) -> Identification:
    return identify(flight, COAXIAL)


def numbers(identification: Identification) -> dict[str, float]:
    return {number.name: number.value for number in identification.parameters}


def test_parameters_of_a_vehicle_are_found(found: Identification) -> None:
    true, tilt = other_helicopter(), found.model.tilt
    assert found.problems == ()
    assert tilt is not None
    assert found.model.input_gain[:3] == pytest.approx(true.input_gain[:3], rel=0.06)
    # The fit of a vehicle that flaps allows for radio frames, which this flight does not have.
    assert tilt.frequency_rad_s == pytest.approx(10.0, rel=0.06)
    assert tilt.damping_ratio == pytest.approx(0.4, rel=0.1)
    assert found.model.delay_s == pytest.approx(0.04, abs=0.006)
    assert found.model.lag_s[2] == pytest.approx(0.13, rel=0.15)
    assert found.model.input_gain[3] == pytest.approx(90.0, rel=0.1)
    assert found.model.damping[3] == pytest.approx(-4.2, rel=0.1)
    assert found.model.lag_s[3] == pytest.approx(0.14, rel=0.1)
    assert found.model.thrust_coupling == pytest.approx(3.5, rel=0.1)


def test_offsets_of_flights_are_separated_from_the_model(flight: FlightRecording) -> None:
    found = identify(flight, COAXIAL, simulated_flight(other_helicopter(), seed=2))
    # The mean of the wind in a single flight shifts the trim by 0.01.
    assert found.offsets.trim == pytest.approx((0.01, -0.02), abs=0.01)
    assert found.offsets.body_rad == pytest.approx((0.03, -0.04), abs=0.006)


def test_deviations_cover_the_truth(found: Identification) -> None:
    true = other_helicopter()
    by_name = {number.name: number for number in found.parameters}
    for name, value in (
        ("pitch gain", true.input_gain[0]),
        ("roll gain", true.input_gain[1]),
        ("tilt frequency", 10.0),
        ("transport delay", 0.04),
    ):
        assert abs(by_name[name].value - value) < 4.0 * by_name[name].deviation
        assert by_name[name].deviation < 0.1 * abs(value)


def test_predictions_of_flight_that_was_not_fitted_become_better(found: Identification) -> None:
    _, height, heading = found.parts
    assert heading.after < heading.before
    assert height.after < height.before


def test_a_fitted_model_is_more_certain_than_a_type(found: Identification) -> None:
    low, high = found.model.uncertainty.tilt_damping or (0.0, 0.0)
    assert replace(found.model.uncertainty, tilt_damping=None) == IDENTIFIED
    assert found.model.tilt is not None
    assert low < found.model.tilt.damping_ratio < high < 2.0 * low


@pytest.mark.parametrize("density", [CALM, pytest.param(0.05, marks=pytest.mark.campaign), 0.1])
def test_gusts_of_a_flight_are_found(density: float) -> None:
    found = identify(simulated_flight(other_helicopter(), gust_density=density), COAXIAL)
    assert found.model.gust_density == density
    assert found.model.input_gain[:2] == pytest.approx(other_helicopter().input_gain[:2], rel=0.15)


@pytest.mark.parametrize("lever_arm_m", [pytest.param(-0.03, marks=pytest.mark.campaign), 0.04])
def test_a_lever_arm_is_told_from_direct_lift_and_gain(lever_arm_m: float) -> None:
    true = replace(other_helicopter(), lever_arm_m=lever_arm_m)
    found = identify(simulated_flight(true), COAXIAL)
    assert found.problems == ()
    assert found.model.lever_arm_m == pytest.approx(lever_arm_m, abs=0.01)
    assert found.model.input_gain[:2] == pytest.approx(true.input_gain[:2], rel=0.12)


def test_positions_alone_are_enough(flight: FlightRecording) -> None:
    found = identify(replace(flight, tilt=None), COAXIAL)
    assert found.problems == ()
    assert found.model.input_gain[:2] == pytest.approx((2.4, 1.8), rel=0.1)
    assert found.model.tilt is not None
    assert found.model.tilt.frequency_rad_s == pytest.approx(10.0, rel=0.05)
    assert not {"body offset forward", "lever arm"} & numbers(found).keys()


def test_a_flight_without_excitation_is_refused() -> None:
    found = identify(still_flight(COAXIAL, 20.0), COAXIAL)
    assert any(problem.startswith("too little excitation: pitch gain") for problem in found.problems)


def test_a_flight_with_sticks_of_another_vehicle_is_refused(flight: FlightRecording) -> None:
    flight = flight.part(0.0, 0.7)
    swapped = replace(flight, inputs=flight.inputs[:, [1, 0, 2, 3]])
    assert identify(swapped, COAXIAL).problems


def test_a_single_wild_pose_does_not_spoil_the_fit(flight: FlightRecording, found: Identification) -> None:
    position = flight.position_m.copy()
    position[700, 0] += 0.2
    spoilt = identify(replace(flight, position_m=position), COAXIAL)
    assert spoilt.model.gust_density == CALM
    assert spoilt.model.input_gain[:2] == pytest.approx(found.model.input_gain[:2], rel=0.1)


def test_a_tilt_without_bar_is_fitted_too() -> None:
    plain = replace(COAXIAL, tilt=TiltModel(frequency_rad_s=14.0, damping_ratio=0.7))
    known = replace(COAXIAL, tilt=TiltModel(frequency_rad_s=11.0, damping_ratio=0.5))
    found = identify(simulated_flight(plain, body_rad=(0.0, 0.0)), known)
    assert found.problems == ()
    assert found.model.tilt is not None
    assert found.model.tilt.frequency_rad_s == pytest.approx(14.0, rel=0.06)


@pytest.mark.parametrize(
    ("rate_rad_s", "time_s", "servo_lag_s"),
    [
        pytest.param(3.5, 0.025, 0.02, marks=pytest.mark.campaign),
        pytest.param(4.3, 0.03, 0.05, marks=pytest.mark.campaign),
        (2.6, 0.02, 0.08),
    ],
)
def test_a_flight_controller_with_a_fast_rate_loop_is_identified(
    rate_rad_s: float, time_s: float, servo_lag_s: float
) -> None:
    """Its yaw answers in less time than the type's, by a rate of its own."""
    assert QUADROTOR.tilt is not None
    fast = replace(
        QUADROTOR,
        input_gain=(*QUADROTOR.input_gain[:3], rate_rad_s / time_s),
        damping=(*QUADROTOR.damping[:3], -1.0 / time_s),
        lag_s=(*QUADROTOR.lag_s[:3], 0.01),
        tilt=replace(QUADROTOR.tilt, servo_lag_s=servo_lag_s),
    )
    found = identify(simulated_flight(fast, body_rad=(0.0, 0.0)), QUADROTOR)
    assert (found.problems, found.remarks) == ((), ())
    assert numbers(found)["yaw rate gain"] == pytest.approx(rate_rad_s, rel=0.05)
    assert numbers(found)["yaw time constant"] + found.model.lag_s[3] == pytest.approx(
        time_s + 0.01, abs=IDENTIFIED.delay_s[U_YAW - 1]
    )
    assert found.model.uncertainty.gain_factor == IDENTIFIED.gain_factor


def test_a_vehicle_without_tilt_model_gets_gains_and_lag(flight: FlightRecording) -> None:
    found = identify(replace(flight, kind=COAXIAL_LAG.kind), COAXIAL_LAG)
    assert found.model.tilt is None
    assert found.model.lag_s[0] > COAXIAL_LAG.lag_s[0]


def test_short_recordings_and_those_of_other_types_are_refused(flight: FlightRecording) -> None:
    with pytest.raises(ValueError, match=r"lasts 12\.0 s, at least 20 s"):
        identify(flight.part(0.0, 0.4), COAXIAL)
    with pytest.raises(ValueError, match="of type coaxial, not quadrotor"):
        identify(flight, QUADROTOR)


def test_hover_thrust_is_the_mean_of_the_flight(flight: FlightRecording, found: Identification) -> None:
    assert found.model.hover_thrust == pytest.approx(float(np.mean(flight.inputs[:, 2])))


def test_height_is_as_certain_as_its_noise_permits(found: Identification) -> None:
    (thrust,) = [number for number in found.parameters if number.name == "thrust gain"]
    assert 0.002 * thrust.value < thrust.deviation < 0.1 * thrust.value
    assert abs(thrust.value - 16.5) < 4.0 * thrust.deviation


def test_a_parameter_on_its_bound_is_said_and_does_not_make_gains_more_certain(
    flight: FlightRecording, found: Identification
) -> None:
    assert found.remarks == ()
    known = replace(COAXIAL, lag_s=(*COAXIAL.lag_s[:3], 0.02))
    doubtful = identify(flight, known)
    assert any(remark.startswith("yaw lag went as far as it may") for remark in doubtful.remarks)
    of_fit, of_type = doubtful.model.uncertainty.axes, known.uncertainty.axes
    assert of_fit[U_YAW].gain_factor == of_type[U_YAW].gain_factor
    assert of_fit[U_YAW].delay_s == of_type[U_YAW].delay_s


def test_a_parameter_on_its_bound_leaves_the_other_axes_as_certain_as_the_fit(
    flight: FlightRecording,
) -> None:
    doubtful = identify(flight, replace(COAXIAL, lag_s=(*COAXIAL.lag_s[:3], 0.02)))
    assert doubtful.model.uncertainty.axes[:U_YAW] == IDENTIFIED.axes[:U_YAW]


def test_a_helicopter_with_a_parameter_on_its_bound_is_flown_no_softer_than_its_type(
    flight: FlightRecording,
) -> None:
    doubtful = identify(flight, replace(COAXIAL, lag_s=(*COAXIAL.lag_s[:3], 0.02)))
    assert doubtful.remarks != ()
    weights, of_type = (default_weights(model, 0.02).inputs for model in (doubtful.model, COAXIAL))
    assert np.less(weights, of_type)[:2].all()


def logged(model: Model, seed: int) -> FlightRecording:
    """A flight whose sticks were logged, with a battery that runs down."""
    one = simulated_flight(model, 20.0, seed=seed)
    return replace(one, battery_v=np.linspace(4.0, 3.4, len(one.yaw_rad)))


def test_flights_that_a_vehicle_logged_are_fitted_together() -> None:
    assert CRAZYFLIE.tilt is not None
    tilt = replace(CRAZYFLIE.tilt, frequency_rad_s=19.0)
    true = replace(CRAZYFLIE, input_gain=(3.4, 3.5, 17.0, 46.5), tilt=tilt)
    found = identify(logged(true, 1), CRAZYFLIE, logged(true, 2))
    assert found.problems == ()
    assert found.model.input_gain[:3] == pytest.approx(true.input_gain[:3], rel=0.08)
    assert found.model.hover_input[2] == pytest.approx(true.hover_input[2], rel=0.02)
    assert found.model.tilt is not None
    assert found.model.tilt.frequency_rad_s == pytest.approx(19.0, rel=0.1)
    assert numbers(found)["thrust per volt"] == pytest.approx(0.0, abs=0.05)


def test_a_flight_at_full_thrust_is_refused() -> None:
    weak = replace(flight_of(CRAZYFLIE), inputs=np.ones_like(flight_of(CRAZYFLIE).inputs))
    with pytest.raises(ValueError, match=r"it flew with 1\.00 of full thrust"):
        identify(weak, CRAZYFLIE)


def test_each_of_several_flights_has_to_last() -> None:
    with pytest.raises(ValueError, match="a recording lasts 5"):
        identify(logged(CRAZYFLIE, 1), CRAZYFLIE, logged(CRAZYFLIE, 2).part(0.0, 0.25))


def flight_of(model: Model) -> FlightRecording:
    return simulated_flight(model, 20.0)


def test_the_push_of_walls_and_wakes_does_not_bias_gains(found: Identification) -> None:
    pushed = identify(simulated_flight(other_helicopter(), trim=(0.25, -0.3)), COAXIAL)
    assert pushed.problems == pushed.remarks == ()
    assert pushed.model.input_gain[:2] == pytest.approx(found.model.input_gain[:2], rel=0.02)
    assert pushed.model.uncertainty.delay_s == IDENTIFIED.delay_s


def test_gains_that_follow_from_settings_are_kept() -> None:
    known = replace(QUADROTOR, sticks_known=True)
    gain = known.input_gain
    other = replace(known, input_gain=(0.7 * gain[0], 1.3 * gain[1], 1.1 * gain[2], 1.2 * gain[3]))
    found = identify(simulated_flight(other), known)
    assert not {"pitch gain", "roll gain", "yaw rate gain"} & numbers(found).keys()
    assert found.model.input_gain[:2] == gain[:2]
    assert found.model.input_gain[3] / -found.model.damping[3] == pytest.approx(gain[3] / -known.damping[3])
    assert found.model.uncertainty.gain_factor >= IDENTIFIED.gain_factor


def quiet(flight: FlightRecording, axis: int) -> FlightRecording:
    """A vehicle that was excited in every axis but one."""
    excitation = excitation_for(other_helicopter(), flight.duration_s)
    amplitude = tuple(0.0 if one == axis else size for one, size in enumerate(excitation.amplitude))
    return simulated_flight(
        other_helicopter(), flight.duration_s, Excitation(amplitude, excitation.duration_s)
    )


def test_a_heading_that_nothing_excites_stays_as_it_is(flight: FlightRecording) -> None:
    found = identify(quiet(flight, U_YAW), COAXIAL)
    assert found.accepted == (HORIZONTAL, HEIGHT)
    assert [problem.startswith("too little excitation: yaw rate gain") for problem in found.problems] == [
        True
    ]
    assert found.model.input_gain[U_YAW] == COAXIAL.input_gain[U_YAW]
    assert (found.model.lag_s[U_YAW], found.model.thrust_coupling) == (
        COAXIAL.lag_s[U_YAW],
        COAXIAL.thrust_coupling,
    )
    assert found.model.uncertainty.axes[U_YAW] == COAXIAL.uncertainty.axes[U_YAW]
    assert found.model.uncertainty.axes[:U_YAW] == IDENTIFIED.axes[:U_YAW]


def test_of_an_ordinary_flight_no_gain_beyond_the_uncertainty_is_accepted(flight: FlightRecording) -> None:
    strong = replace(COAXIAL, input_gain=(*COAXIAL.input_gain[:2], 28.0, COAXIAL.input_gain[U_YAW]))
    found = identify(flight, strong, ordinary=True)
    assert found.accepted == (HORIZONTAL, HEADING)
    assert any(
        problem.endswith("times that of the type: at most 1.45 is learned") for problem in found.problems
    )
    assert found.model.hover_thrust == strong.hover_thrust
    assert found.model.input_gain[U_THRUST] == strong.input_gain[U_THRUST]
    assert found.model.input_gain[:2] == pytest.approx(other_helicopter().input_gain[:2], rel=0.06)


def test_nothing_changes_where_every_part_is_refused(flight: FlightRecording) -> None:
    another = replace(COAXIAL, input_gain=(1.2, 1.0, 28.0, 40.0))
    found = identify(flight, another, ordinary=True)
    assert found.accepted == ()
    assert found.model == another
