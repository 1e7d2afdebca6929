"""Steps within bounds are the same, to the last bit, as those that are solved problem by problem."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcopterx.control.controllers.cascade.controller import CascadeController, CascadeSettings
from rcopterx.control.controllers.cascade.within_bounds import StepWithinBounds
from rcopterx.control.controllers.chains.chain_qp import ChainQP
from rcopterx.control.interfaces import NO_TILT, Estimate, LimitScale, Obstacle, TiltEstimate
from rcopterx.control.references.trajectory import hold
from rcopterx.vehicles.state import Array
from rcopterx.vehicles.types import COAXIAL

PERIOD_S = 0.02
STAGES = 20
STEPS = 40


class InTurn(CascadeController):
    """A cascade that never knows that its workspace is its own."""

    workspace = type("OtherQP", (ChainQP,), {})


def flight(random: np.random.Generator, reach_m: float, tilted: bool) -> list[tuple[Estimate, Array]]:
    """Estimates of a vehicle that is shaken, and set points."""
    assert COAXIAL.tilt is not None
    states = COAXIAL.tilt.dynamics().size
    motion, actuator = np.array([0, 0, 1.0, 0, 0, 0, 0, 0]), COAXIAL.hover_input.copy()
    found, place = [], np.array([0, 0, 1.0, 0])
    for step in range(STEPS):
        if step % 10 == 0:
            place = np.array([0, 0, 1.0, 0]) + reach_m * random.uniform(-1.0, 1.0, 4)
        motion = motion + random.normal(0.0, 1e-3, 8) + 0.02 * np.append(place - motion[:4], np.zeros(4))
        tilt = TiltEstimate(*(random.normal(0.0, 1e-2, size) for size in (states, 2, 2, 2)))
        disturbance = random.normal(0.0, 0.1, 4)
        found.append((Estimate(motion, actuator, disturbance, tilt if tilted else NO_TILT), place))
    return found


def told(controller: CascadeController, flown: list[tuple[Estimate, Array]]) -> list[Any]:
    """Steps of a flight in which its leader's limits change and somebody comes near for a while."""
    controller.reset(flown[0][0], COAXIAL.hover_input)
    answers = []
    for number, (estimate, place) in enumerate(flown):
        if number == 15:
            controller.set_limit_scale(LimitScale(4 * (0.7,)))
        near = Obstacle(np.tile(estimate.motion[:3] + 0.3, (STAGES, 1)), 0.5, 0.8)
        controller.set_obstacles([near] if 20 <= number < 23 else [])
        reference = hold(place[:3], float(place[3]), PERIOD_S, STAGES)
        step = controller.step(estimate, reference, COAXIAL.hover_input)
        answers.append((step.inputs.tobytes(), step.plan.samples.tobytes(), step.fallback, step.iterations))
    return answers


@settings(max_examples=30)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.1, 0.4, 0.6, 3.0]),
    st.booleans(),
    st.booleans(),
)
def test_steps_are_those_of_problems_that_are_solved_in_turn(
    seed: int, reach_m: float, tilted: bool, compensated: bool
) -> None:
    flown = flight(np.random.default_rng(seed), reach_m, tilted)
    asked = CascadeSettings(horizon=STAGES, disturbance_compensation=compensated)
    one, other = (kind(COAXIAL, PERIOD_S, asked) for kind in (CascadeController, InTurn))
    assert told(one, flown) == told(other, flown)


@pytest.mark.parametrize(("reach_m", "least", "most"), [(0.1, STEPS // 2, STEPS), (0.5, 3, STEPS // 2)])
def test_steps_are_within_bounds_where_nothing_presses(
    reach_m: float, least: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = []
    attempt = StepWithinBounds.attempt

    def noted(self: StepWithinBounds, *question: Any) -> Any:
        answer = attempt(self, *question)
        taken.append(answer is not None)
        return answer

    monkeypatch.setattr(StepWithinBounds, "attempt", noted)
    controller = CascadeController(COAXIAL, PERIOD_S, CascadeSettings(horizon=STAGES))
    told(controller, flight(np.random.default_rng(1), reach_m, tilted=True))
    assert len(taken) == STEPS - 3
    assert not taken[0]
    assert least <= sum(taken) < most
