"""The paper's scheme: its model, its scaling, its behaviour."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from support.equation_one import motion_derivative
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.guards.step_guard import StepGuard
from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.trajectory import hold
from rcopterx.vehicles.state import YAW, Array, heading_matrix
from rcopterx_studies.baselines.paper import PaperController, PaperSettings
from rcopterx_studies.baselines.paper_model import PaperModel, TerminalCost

PERIOD_S = 0.02


def at_rest(x: float = 0.0, y: float = 0.0, z: float = 1.0, yaw: float = 0.0) -> Estimate:
    return Estimate(np.array([x, y, z, yaw, 0, 0, 0, 0]), COAXIAL_LAG.hover_input, np.zeros(4))


def make(**settings: object) -> PaperController:
    unhurried = {"time_limit_s": 1.0, **settings}
    return PaperController(COAXIAL_LAG, PERIOD_S, PaperSettings(**unhurried))  # type: ignore[arg-type]  # free-form test settings


def fly(controller: PaperController, estimate: Estimate, target: Array, steps: int, trim: Array) -> Array:
    """Motion states of a flight of the continuous model; `trim` adds to the input."""
    last, motion, flown = COAXIAL_LAG.hover_input, estimate.motion.copy(), []
    reference = hold(target[:3], float(target[3]), PERIOD_S, controller.horizon)
    for _ in range(steps):
        result = controller.step(Estimate(motion.copy(), last, np.zeros(4)), reference, last)
        assert result.fallback is None
        last = result.inputs[0]
        for _ in range(10):
            motion = motion + 0.002 * motion_derivative(COAXIAL_LAG, motion, last + trim, np.zeros(4))
        flown.append(motion)
    return np.array(flown)


def test_matrices_are_those_of_the_paper() -> None:
    a, c = (
        PaperModel(COAXIAL_LAG, PERIOD_S).dynamics(0.3),
        PaperModel(COAXIAL_LAG, PERIOD_S).affine(np.array([1, 2, 3.0])),
    )
    assert a[0, 4:6] == pytest.approx([0.02 * np.cos(0.3), -0.02 * np.sin(0.3)])
    assert a[1, 4:6] == pytest.approx([0.02 * np.sin(0.3), 0.02 * np.cos(0.3)])
    assert np.diag(a) == pytest.approx([1, 1, 1, 1, 0.99, 0.992, 1, 0.9, 1, 1, 1])
    assert a[[8, 9, 10], [0, 1, 2]] == pytest.approx([0.04, 0.04, 0.04])
    assert c == pytest.approx([0, 0, 0, 0, 0, 0, 0.1962, 0, 0.04, 0.08, 0.12])


@pytest.mark.parametrize("yaw", [0.0, 0.4, -2.0, 3 * np.pi])
def test_rotated_terminal_cost_solves_the_riccati_equation_of_the_heading(yaw: float) -> None:
    paper_model = PaperModel(COAXIAL_LAG, PERIOD_S)
    q, r = np.array([8, 8, 8, 4, 1, 1, 1, 1, 1, 1, 1.0]), np.array([5, 5, 5, 1.0])
    direct = solve_discrete_are(paper_model.dynamics(yaw), paper_model.input_matrix(), np.diag(q), np.diag(r))
    assert TerminalCost(paper_model, q, r).at(yaw) == pytest.approx(direct, rel=1e-6, abs=1e-6)
    q[1] = 9.0
    direct = solve_discrete_are(paper_model.dynamics(yaw), paper_model.input_matrix(), np.diag(q), np.diag(r))
    # headings are rounded to a hundredth of a radian when Q is not isotropic
    assert TerminalCost(paper_model, q, r).at(yaw) == pytest.approx(direct, rel=1e-2, abs=1.0)


def test_first_input_of_the_unconstrained_problem_is_the_linear_quadratic_regulator() -> None:
    controller = make(horizon=30)
    controller.reset(at_rest(), COAXIAL_LAG.hover_input)
    state = np.array([0.05, -0.03, 1.04, 0.1, 0.02, 0.01, -0.02, 0.05])
    result = controller.step(
        Estimate(state, COAXIAL_LAG.hover_input, np.zeros(4)),
        hold(np.array([0, 0, 1.0]), 0.0, PERIOD_S, 30),
        COAXIAL_LAG.hover_input,
    )
    q, r = np.array(PaperSettings().state_weights), np.array(PaperSettings().input_weights)
    gain = TerminalCost(PaperModel(COAXIAL_LAG, PERIOD_S), q, r).gain(0.0)
    error = np.concatenate((state - [0, 0, 1, 0, 0, 0, 0, 0], np.zeros(3)))
    assert result.fallback is None
    assert result.inputs[0] == pytest.approx(COAXIAL_LAG.hover_input - gain @ error, abs=2e-3)


def test_set_point_with_yaw_is_reached_and_trim_is_integrated_away() -> None:
    controller = make(horizon=25)
    controller.reset(at_rest(), COAXIAL_LAG.hover_input)
    target = np.array([0.4, -0.3, 1.3, 1.0])
    flown = fly(controller, at_rest(), target, 900, trim=np.array([0.01, -0.01, 0.005, 0.0]))
    assert np.abs(flown[-1, :3] - target[:3]).max() < 0.02
    assert abs(flown[-1, 3] - target[3]) < 0.05


def test_without_z_integrator_a_thrust_trim_leaves_a_height_error() -> None:
    trim = np.array([0, 0, 0.01, 0])
    errors = []
    for z_integrator in (True, False):
        controller = make(horizon=20, z_integrator=z_integrator)
        controller.reset(at_rest(), COAXIAL_LAG.hover_input)
        errors.append(abs(fly(controller, at_rest(), np.array([0, 0, 1.0, 0]), 700, trim)[-1, 2] - 1.0))
    assert errors[0] < 2e-3 < 5e-3 < errors[1]


def test_matrices_return_to_the_same_problem_after_a_turn() -> None:
    """The factor of another heading must not be used."""
    results = []
    turned = make(horizon=20)
    turned.reset(at_rest(), COAXIAL_LAG.hover_input)
    turned.step(at_rest(), hold(np.array([0.1, 0, 1]), 2.0, PERIOD_S, 20), COAXIAL_LAG.hover_input)
    for controller in (turned, make(horizon=20), make(horizon=20, solver="osqp")):
        controller.reset(at_rest(), COAXIAL_LAG.hover_input)
        reference = hold(np.array([0.1, 0.05, 1]), 0.0, PERIOD_S, 20)
        results.append(controller.step(at_rest(), reference, COAXIAL_LAG.hover_input).inputs[0])
    assert results[0] == pytest.approx(results[1], abs=1e-3)
    assert results[2] == pytest.approx(results[1], abs=1e-3)


@pytest.mark.parametrize("yaw", [0.0, np.pi / 2, np.pi, -1.0])
def test_reference_velocity_is_turned_into_the_body_frame(yaw: float) -> None:
    """A reference that flies along +x_I makes a vehicle of any heading pitch and roll along +x_I."""
    controller = make(horizon=30)
    reference = hold(np.zeros(3), yaw, PERIOD_S, 30)
    samples = reference.samples.copy()
    samples[:, 0] = 0.5 * PERIOD_S * np.arange(30)
    samples[:, 2] = 1.0
    samples[:, 4] = 0.5
    controller.reset(at_rest(yaw=yaw), COAXIAL_LAG.hover_input)
    inputs = controller.step(
        at_rest(yaw=yaw), type(reference)(samples, PERIOD_S), COAXIAL_LAG.hover_input
    ).inputs[0]
    push = heading_matrix(yaw) @ (COAXIAL_LAG.b[:2] * inputs[:2])
    assert push[0] > 0.1
    assert abs(push[1]) < 0.05 * push[0]


def test_plan_starts_at_the_measurement_and_moves_with_its_velocity() -> None:
    controller = make(horizon=40)
    start = at_rest(yaw=0.5)
    controller.reset(start, COAXIAL_LAG.hover_input)
    plan = controller.step(
        start, hold(np.array([0.5, 0.2, 1.2]), 0.5, PERIOD_S, 40), COAXIAL_LAG.hover_input
    ).plan
    assert plan.samples[0, :8] == pytest.approx(start.motion)
    # the heading stays at the linearisation point, so frozen and true kinematics agree
    assert np.abs(plan.yaw_rad - 0.5).max() < 1e-3
    assert np.diff(plan.samples[:, :3], axis=0) / PERIOD_S == pytest.approx(plan.velocity_m_s[:-1], abs=1e-3)
    assert np.diff(plan.velocity_m_s, axis=0) / PERIOD_S == pytest.approx(plan.samples[:-1, 8:11])


def test_first_step_after_a_switch_takes_over_the_trim() -> None:
    """In hover with a trimmed input the new controller continues with that input."""
    trimmed = COAXIAL_LAG.hover_input + np.array([0.05, -0.04, 0.01, 0.0])
    controller = make(horizon=40)
    controller.reset(at_rest(), trimmed)
    result = controller.step(at_rest(), hold(np.array([0, 0, 1.0]), 0.0, PERIOD_S, 40), trimmed)
    assert result.inputs[0] == pytest.approx(trimmed, abs=5e-3)


def test_an_exhausted_time_limit_is_reported_and_still_gives_a_command() -> None:
    controller = make(horizon=110, solver="osqp", time_limit_s=1e-5)
    guard = StepGuard(COAXIAL_LAG, controller)
    guard.reset(at_rest(), COAXIAL_LAG.hover_input)
    seen = set()
    for yaw in np.linspace(0, 3, 20):
        state = at_rest(yaw=float(yaw)).motion
        state[YAW + 1 :] = 0.5
        estimate = Estimate(state, COAXIAL_LAG.hover_input, np.zeros(4))
        far = hold(np.array([1, 1, 1.8]), 3.0, PERIOD_S, 110)
        result = guard.step(estimate, far, COAXIAL_LAG.hover_input)
        seen.add(result.fallback)
        assert (result.inputs >= COAXIAL_LAG.u_min).all()
        assert (result.inputs <= COAXIAL_LAG.u_max).all()
    assert seen & {"early_stop", "shifted_plan", "hover"}
    assert None not in seen
    assert not guard.calls.failures
    assert not guard.given_up
