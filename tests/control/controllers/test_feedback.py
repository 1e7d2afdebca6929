"""Linear-quadratic regulator and PID: flights of the continuous model, and their plans."""

import numpy as np
import pytest
from support.equation_one import motion_derivative
from support.vehicle_types import COAXIAL_LAG

from rcopterx.control.interfaces import Controller, Estimate
from rcopterx.control.plugins import CONTROLLERS
from rcopterx.control.references.trajectory import hold
from rcopterx.vehicles.state import Array, heading_matrix

PERIOD_S = 0.02
HOVER = COAXIAL_LAG.hover_input
LAG_S = np.array(COAXIAL_LAG.lag_s)


def fly(controller: Controller, target: Array, steps: int, trim: Array, start: Array) -> Array:
    """Motion states of a flight with actuator lags; `trim` adds to the input."""
    motion, actuator, last, flown = start.copy(), HOVER.copy(), HOVER, []
    controller.reset(Estimate(motion, actuator, np.zeros(4)), last)
    reference = hold(target[:3], float(target[3]), PERIOD_S, controller.horizon)
    for _ in range(steps):
        result = controller.step(Estimate(motion.copy(), actuator.copy(), np.zeros(4)), reference, last)
        assert result.fallback is None
        last = result.inputs[0]
        for _ in range(5):
            actuator = last + trim + (actuator - last - trim) * np.exp(-0.004 / LAG_S)
            motion = motion + 0.004 * motion_derivative(COAXIAL_LAG, motion, actuator, np.zeros(4))
        flown.append(motion)
    return np.array(flown)


@pytest.mark.parametrize("name", ["lqr", "pid"])
@pytest.mark.parametrize("heading", [0.0, 2.0, -np.pi])
def test_set_point_is_reached_at_any_heading_and_trim_is_integrated_away(name: str, heading: float) -> None:
    controller = CONTROLLERS.build(name, COAXIAL_LAG, PERIOD_S, {"horizon": 5})
    start = np.array([0, 0, 1.0, heading, 0, 0, 0, 0])
    target = np.array([0.6, -0.4, 1.4, heading + 1.0])
    flown = fly(controller, target, 900, np.array([0.02, -0.02, 0.01, 0.0]), start)
    assert np.abs(flown[-1, :3] - target[:3]).max() < 0.015
    assert abs(flown[-1, 3] - target[3]) < 0.02
    assert np.abs(flown[:, 4:7]).max() < 1.3


@pytest.mark.parametrize("name", ["lqr", "pid"])
def test_plan_foresees_the_closed_loop(name: str) -> None:
    """The plan of the first step is what the loop then flies, up to the integration of the model."""
    controller = CONTROLLERS.build(name, COAXIAL_LAG, PERIOD_S, {"horizon": 60})
    start = np.array([0, 0, 1.0, 0.3, 0, 0, 0, 0])
    target = np.array([0.3, 0.2, 1.1, 0.8])
    estimate = Estimate(start, HOVER.copy(), np.zeros(4))
    controller.reset(estimate, HOVER)
    plan = controller.step(estimate, hold(target[:3], float(target[3]), PERIOD_S, 60), HOVER).plan
    flown = fly(controller, target, 59, np.zeros(4), start)
    assert plan.samples[0, :4] == pytest.approx(start[:4])
    assert plan.samples[1:, :3] == pytest.approx(flown[:, :3], abs=0.03)


@pytest.mark.parametrize("name", ["lqr", "pid"])
@pytest.mark.parametrize("heading", [0.0, np.pi / 2, 3.0])
def test_reference_velocity_counts_in_the_direction_it_has_in_the_room(name: str, heading: float) -> None:
    controller = CONTROLLERS.build(name, COAXIAL_LAG, PERIOD_S, {"horizon": 10})
    estimate = Estimate(np.array([0, 0, 1.0, heading, 0, 0, 0, 0]), HOVER.copy(), np.zeros(4))
    reference = hold(np.array([0, 0, 1.0]), heading, PERIOD_S, 10)
    reference.samples[:, 4] = 0.1
    controller.reset(estimate, HOVER)
    push = heading_matrix(heading) @ (
        COAXIAL_LAG.b[:2] * controller.step(estimate, reference, HOVER).inputs[0, :2]
    )
    assert push[0] > 0.05
    assert abs(push[1]) < 0.1 * push[0]


@pytest.mark.parametrize("name", ["lqr", "pid"])
def test_first_step_after_a_switch_takes_over_the_trim(name: str) -> None:
    trimmed = HOVER + np.array([0.05, -0.04, 0.01, 0.0])
    controller = CONTROLLERS.build(name, COAXIAL_LAG, PERIOD_S, {})
    hovering = Estimate(np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0]), trimmed, np.zeros(4))
    controller.reset(hovering, trimmed)
    result = controller.step(hovering, hold(np.array([0, 0, 1.0]), 1.0, PERIOD_S, 50), trimmed)
    assert result.inputs[0] == pytest.approx(trimmed, abs=1e-9)


@pytest.mark.parametrize("name", ["lqr", "pid"])
def test_a_saturated_input_winds_nothing_up(name: str) -> None:
    """Held back for five seconds, the vehicle is not thrown past its set point afterwards."""
    controller = CONTROLLERS.build(
        name, COAXIAL_LAG, PERIOD_S, {"horizon": 5, "input_max": [0.05, 1, 1, 0.4]}
    )
    start = np.array([-1.0, 0, 1.0, 0, 0, 0, 0, 0])
    flown = fly(controller, np.array([0, 0, 1.0, 0]), 1500, np.zeros(4), start)
    assert flown[:, 0].max() < 0.25
    assert abs(flown[-1, 0]) < 0.03
