"""The linear loop that margins are computed from is the loop that flies."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.records import replace as changed
from support.vehicle_types import COAXIAL

from rcopterx.control.controllers.cascade.axis import AxisProblem, CascadeTask, recovery
from rcopterx.control.controllers.cascade.controller import CascadeSettings
from rcopterx.control.controllers.cascade.lateral import LateralTilt, with_tilt
from rcopterx.control.controllers.cascade.weights import (
    CascadeWeights,
    default_weights,
)
from rcopterx.control.estimators.extended_kalman import ExtendedKalmanEstimator
from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.interfaces import Measurement, at_rest
from rcopterx.control.margins.axes import lag_loop, tilt_loop
from rcopterx.control.margins.loop import FeedbackLoop, Perturbation, margins
from rcopterx.control.models.linear import zero_order_hold
from rcopterx.control.solver.problem import OptimalControlProblem
from rcopterx.control.solver.sweep import Factor, factorize
from rcopterx.vehicles.model import Departures, Model
from rcopterx.vehicles.state import U_THRUST, U_YAW, Array, heading_matrix

PERIOD_S = 0.02
EVEN = replace(COAXIAL, input_gain=(2.0, 2.0, 18.0, 111.0))
"""The loop takes the gains of both sticks as one."""


def delayed_integrator(delay_s: float, gain: float) -> FeedbackLoop:
    """Velocity from thrust, known exactly: a loop whose limits are known in closed form."""

    def step(_: float, __: float | None, time_s: float) -> tuple[Array, Array]:
        return zero_order_hold(np.zeros((1, 1)), np.ones(1), time_s)

    return FeedbackLoop(
        plant_step=step,
        measured=np.eye(1),
        filter_step=lambda time_s: step(1.0, None, time_s),
        filter_measured=np.eye(1),
        filter_gain=np.eye(1),
        feedback=np.array([gain]),
        period_s=PERIOD_S,
        delay_s=delay_s,
        rule=Departures(1.0, 0.0, 0.0),
    )


def test_a_sampled_integrator_becomes_unstable_at_twice_the_deadbeat_gain() -> None:
    loop = delayed_integrator(0.0, 0.5 / PERIOD_S)
    assert loop.stable(Perturbation(gain=3.99))
    assert not loop.stable(Perturbation(gain=4.01))
    assert not loop.stable(Perturbation(gain=-0.01))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_peak_sensitivity_of_a_sampled_integrator_is_that_of_its_closed_form(share: float) -> None:
    """S = (z - 1) / (z - 1 + k T) is largest where z = -1."""
    loop = delayed_integrator(0.0, share / PERIOD_S)
    assert loop.peak_sensitivities()[0] == pytest.approx(2.0 / (2.0 - share), rel=1e-6)


def test_peak_sensitivity_of_an_unstable_loop_is_infinite() -> None:
    assert delayed_integrator(0.0, -0.1).peak_sensitivities()[0] == math.inf


def test_the_gain_margin_is_at_least_what_the_peak_sensitivity_promises() -> None:
    loop = tilt_loop(COAXIAL, PERIOD_S, (100.0, 40.0, 1.5))
    peak = loop.peak_sensitivities()[0]
    assert peak > 1.0
    assert margins(loop).gain_up > peak / (peak - 1.0)
    assert margins(loop).phase_rad > 2.0 * math.asin(0.5 / peak)


def test_several_perturbed_loops_at_once_are_each_of_them() -> None:
    loop = tilt_loop(COAXIAL, PERIOD_S, (100.0, 1.0, 0.12))
    perturbed = [Perturbation(gain=9.0), Perturbation(delay_s=0.03), Perturbation(frequency=0.7, damping=0.3)]
    together = loop.all_stable(perturbed).tolist()
    assert together == [loop.stable(each) for each in perturbed]
    assert {True, False} == set(together)


def test_damping_that_no_such_vehicle_has_is_replaced_by_the_nearest() -> None:
    model = replace(COAXIAL, uncertainty=replace(COAXIAL.uncertainty, tilt_damping=(0.2, 0.5)))
    loop = tilt_loop(model, PERIOD_S, (100.0, 1.0, 0.12))
    assert loop.dampings == (0.2, 0.5)
    as_is, least = loop.closed_loops((Perturbation(), Perturbation(damping=0.2)))
    assert np.array_equal(as_is, least)


@pytest.mark.parametrize("delay_s", [0.0, 0.007, 0.02, 0.033, 0.06])
def test_a_known_delay_is_predicted_so_that_the_poles_stay_where_they_were(delay_s: float) -> None:
    poles = np.abs(np.linalg.eigvals(delayed_integrator(delay_s, 10.0).closed_loops((Perturbation(),))))
    assert poles.max() == pytest.approx(1.0 - 10.0 * PERIOD_S)
    assert (np.sort(poles)[:-1] < 1e-4).all()


def test_a_delay_of_a_period_is_the_same_from_above_and_below() -> None:
    loop = tilt_loop(COAXIAL, PERIOD_S, (100.0, 1.0, 2.4))
    below, above = (
        np.abs(np.linalg.eigvals(loop.closed_loops((Perturbation(delay_s=delay_s),)))).max()
        for delay_s in (0.02 - 1e-7, 0.02 + 1e-7)
    )
    assert below == pytest.approx(above, abs=1e-5)


def feedback_of(problem: OptimalControlProblem) -> Array:
    """Feedback of the first input on the state while no bound is active, u = -feedback x."""
    stages, nx, nu = problem.B.shape
    factor, none = Factor.empty(stages, nx, nu), np.zeros(problem.W.shape)
    factorize(problem, none, none, factor)
    return -factor.K[0]


def weights_of(states: tuple[float, ...], efforts: tuple[float, ...]) -> CascadeWeights:
    return CascadeWeights(np.array(states[:4]), np.array(states[4:]), np.array(efforts), 1e5)


def resting(model: Model) -> CascadeTask:
    """Task of a vehicle that rests at the origin."""
    limits = CascadeSettings().limits(model)
    hovering = at_rest(model)._replace(motion=np.eye(8)[2])
    return CascadeTask(hovering, np.zeros(4), np.zeros((21, 12)), limits, recovery(PERIOD_S, 20))


def test_both_horizontal_axes_have_the_feedback_of_the_cascade() -> None:
    weights = weights_of((100.0, 100.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0), (10.0, 10.0, 1.0, 1.0))
    formulation = LateralTilt(EVEN, PERIOD_S, weights, 20, True)
    task = resting(EVEN)
    task = changed(task, estimate=with_tilt(EVEN, task.estimate, np.zeros(4), True))
    gain = feedback_of(formulation.along(np.zeros(22), task))
    loop = tilt_loop(EVEN, PERIOD_S, (100.0, 1.0, 10.0 / 4.0))
    known = gain.shape[1] // 2
    assert loop.feedback[:known] == pytest.approx(gain[0, 0::2] + 1j * gain[1, 0::2], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("axis", [U_THRUST, U_YAW])
def test_height_and_yaw_have_the_feedback_of_the_cascade(axis: int) -> None:
    states, efforts = default_weights(COAXIAL, PERIOD_S)
    weights = weights_of(states, efforts)
    formulation = AxisProblem(slice(axis, axis + 1), COAXIAL, PERIOD_S, weights, 20, True)
    gain = feedback_of(formulation.problem(resting(COAXIAL)))
    loop = lag_loop(COAXIAL, PERIOD_S, axis, (states[axis], states[4 + axis], efforts[axis]))
    assert loop.feedback[:3] == pytest.approx(gain[0], rel=1e-6)
    assert loop.feedback[3] * COAXIAL.input_gain[axis] == pytest.approx(1.0 + loop.feedback[2])


@pytest.mark.parametrize("model", [EVEN, replace(EVEN, tilt=replace(EVEN.tilt, bar_time_constant_s=None))])
def test_the_filter_of_the_loop_answers_as_the_one_that_flies(model: Model) -> None:
    """Gain of the filter after a minute, columns of measured position and tilt."""
    settings = ExtendedKalmanSettings(tilt_density=4.9, wind_rms_m_s2=0.15)
    estimator = ExtendedKalmanEstimator(model, PERIOD_S, settings)
    at = Measurement(np.array([0.0, 0.0, 1.0]), 0.0, np.zeros(2))
    estimator.reset(at)
    for _ in range(3000):
        estimator.predict(model.hover_input, PERIOD_S)
        estimator.correct(at)
    before = np.array(estimator.estimate.tilt.core)
    estimator.predict(model.hover_input, PERIOD_S)
    estimator.correct(Measurement(np.array([1e-3, 0.0, 1.0]), at.yaw_rad, np.array([0.0, 1e-3])))
    change = (np.array(estimator.estimate.tilt.core) - before) / 1e-3
    loop = tilt_loop(model, PERIOD_S, (100.0, 1.0, 2.4), settings)
    # position forward, tilt to the left
    expected = loop.filter_gain @ np.array([1.0, 1j])
    core = expected[2 : 2 + len(change) // 2]
    # the direction of the bar settles over minutes
    assert change[0::2] + 1j * change[1::2] == pytest.approx(core, rel=0.05, abs=1e-3)


def test_complex_numbers_turn_as_headings_do() -> None:
    turned = heading_matrix(0.3)
    assert turned[0, 0] + 1j * turned[1, 0] == pytest.approx(np.exp(0.3j))
