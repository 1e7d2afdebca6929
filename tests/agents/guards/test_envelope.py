"""The flight envelope: what a vehicle can come to rest from is flown, what it cannot is not."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.flight import still
from support.vehicle_types import COAXIAL

from rcopterx.agents.guards.envelope import FAST, SPINNING, Envelope
from rcopterx.agents.guards.step_guard import BRIDGED_S, DEFAULT_CONTROLLER, StepGuard
from rcopterx.control.interfaces import Controller, ControlStep, Estimate, Obstacle, never
from rcopterx.control.plugins import CONTROLLERS
from rcopterx.control.references.columns import POSITION, VELOCITY, YAW_RATE
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.vehicles.state import U_THRUST, Array

PERIOD_S = 0.02
STAGES = 30
ENVELOPE = Envelope(COAXIAL, BRIDGED_S)
HOVER = COAXIAL.hover_input
MIDDLE_M = (0.0, 0.0, 1.0)


def moving(
    place_m: tuple[float, float, float] = MIDDLE_M,
    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
    yaw_rate_rad_s: float = 0.0,
) -> Trajectory:
    """A vehicle that passes a place at the time until which planned inputs may act."""
    plan = hold(np.zeros(3), 0.0, PERIOD_S, STAGES)
    since_s = PERIOD_S * np.arange(STAGES)[:, None] - BRIDGED_S
    plan.samples[:, POSITION] = np.array(place_m) + since_s * np.array(velocity_m_s)
    plan.samples[:, VELOCITY] = velocity_m_s
    plan.samples[:, YAW_RATE] = yaw_rate_rad_s
    return plan


def other(place_m: tuple[float, float, float]) -> Obstacle:
    return Obstacle(np.tile(place_m, (STAGES, 1)), np.tile((0.35, 0.35, 0.6), (STAGES, 1)))


@pytest.mark.parametrize(
    ("plan", "problem"),
    [
        (moving(), None),
        (moving(velocity_m_s=(0.8, -0.5, 0.5)), None),
        (moving(velocity_m_s=(0.0, 0.0, -0.8)), None),
        (moving((0.0, 0.0, 0.03), (0.0, 0.0, -0.35)), None),
        (moving((0.0, 0.0, 0.3), (0.0, 0.0, -1.8)), "hit the floor"),
        (moving((0.0, 0.0, 1.7), (0.0, 0.0, 1.5)), "leave its volume"),
        (moving((1.0, 0.0, 1.0), (0.8, 0.0, 0.0)), "leave its volume"),
        (moving((0.0, -1.0, 1.0), (0.0, -0.8, 0.0)), "leave its volume"),
        (moving((-0.9, 0.0, 1.0), (FAST * 1.35, 0.0, 0.0)), "volume"),
        (moving(yaw_rate_rad_s=-SPINNING * 2.6), "too fast"),
    ],
)
def test_a_way_is_flown_if_the_vehicle_can_come_to_rest(plan: Trajectory, problem: str | None) -> None:
    found = ENVELOPE.problem(plan, ())
    assert found is None if problem is None else found is not None and problem in found


def test_a_way_towards_another_vehicle_is_flown_while_it_can_end_before() -> None:
    ahead = other((0.8, 0.0, 1.0))
    assert ENVELOPE.problem(moving(), (ahead,)) is None
    assert ENVELOPE.problem(moving(velocity_m_s=(0.3, 0.0, 0.0)), (ahead,)) is None
    assert "too near" in str(ENVELOPE.problem(moving(velocity_m_s=(0.9, 0.0, 0.0)), (ahead,)))
    assert "too near" in str(ENVELOPE.problem(moving(), (other((0.2, 0.0, 1.0)),)))


@given(st.floats(0.05, 1.9), st.floats(-3.0, 0.0))
def test_what_is_allowed_reaches_the_floor_slowly_also_with_the_weakest_thrust(
    height_m: float, climb_m_s: float
) -> None:
    if ENVELOPE.problem(moving((0.0, 0.0, height_m), (0.0, 0.0, climb_m_s)), ()) is not None:
        return
    thrust_m_s2 = COAXIAL.sure_reach[1]
    reacting_s = COAXIAL.lag_s[U_THRUST] + COAXIAL.uncertainty.delay_s[1]
    height_m += reacting_s * climb_m_s
    squared = climb_m_s**2 - 2.0 * thrust_m_s2 * max(height_m, 0.0)
    assert squared <= 0.5**2 + 1e-9


class Pushing:
    """A controller of another package that commands one input for ever."""

    horizon, period_s = STAGES, PERIOD_S

    def __init__(self, command: Array) -> None:
        self.command = command

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Nothing to reset."""

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        return ControlStep(np.tile(self.command, (STAGES - 1, 1)), reference, None, 0)


def guard(controller: Controller) -> StepGuard:
    default = CONTROLLERS.build("pid", COAXIAL, PERIOD_S, {"horizon": STAGES})
    made = StepGuard(COAXIAL, controller, default)
    made.reset(low(), HOVER)
    return made


def low() -> Estimate:
    """At rest near the floor."""
    return Estimate(still((0.0, 0.0, 0.4)).motion, HOVER, np.zeros(4))


def test_unsafe_inputs_are_replaced_at_once_and_the_controller_after_a_while() -> None:
    falling = HOVER * np.array([1.0, 1.0, 0.0, 1.0])
    controller = Pushing(falling)
    made, reference = guard(controller), hold(np.array([0.0, 0.0, 0.4]), 0.0, PERIOD_S, STAGES)
    for _ in range(5):
        assert not made.given_up
        step = made.step(low(), reference, HOVER)
        assert step.fallback == DEFAULT_CONTROLLER
        assert step.inputs[0, U_THRUST] > 0.8 * HOVER[U_THRUST]
    assert made.given_up
    assert made.calls.failures["controller_unsafe"] == 5
    assert "floor" in made.calls.failure


def test_the_plan_of_a_foreign_controller_is_what_its_inputs_fly() -> None:
    ahead = HOVER + np.array([0.5, 0.0, 0.0, 0.0])
    controller = Pushing(ahead)
    reference = hold(np.array([0.0, 0.0, 0.4]), 0.0, PERIOD_S, STAGES)
    step = guard(controller).step(low(), reference, HOVER)
    assert step.fallback is None
    assert step.plan.position_m[-1, 0] > 0.05


def test_built_in_controllers_are_trusted() -> None:
    controller = CONTROLLERS.build("pid", COAXIAL, PERIOD_S, {"horizon": STAGES})
    made = guard(controller)
    fast = Estimate(np.array([1.1, 0.0, 1.0, 0.0, 1.5, 0.0, 0.0, 0.0]), HOVER, np.zeros(4))
    made.step(fast, hold(np.array(MIDDLE_M), 0.0, PERIOD_S, STAGES), HOVER)
    assert not made.calls.failures["controller_unsafe"]
