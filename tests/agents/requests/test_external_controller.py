"""A controller outside the agent: its answers fly, late ones are bridged, wrong ones are refused."""

import numpy as np
import pytest
from support.vehicle_types import COAXIAL_LAG
from support.waiting import FakeClock

from rcopterx.agents.requests.external_control import ExternalController
from rcopterx.agents.tuning.configuration import Configuration
from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.trajectory import hold

PERIOD_S = 0.02
HOVER = COAXIAL_LAG.hover_input
REST = Estimate(np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), HOVER.copy(), np.zeros(4))
REFERENCE = hold(np.array([0.0, 0.0, 1.0]), 0.0, PERIOD_S, 10)


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


@pytest.fixture
def controller(clock: FakeClock) -> ExternalController:
    own = Configuration("pid", "kalman", {"horizon": 10}).controller_for(COAXIAL_LAG, PERIOD_S)
    external = ExternalController(own, COAXIAL_LAG, 0.1, clock)
    external.reset(REST, HOVER)
    return external


def step(controller: ExternalController) -> np.ndarray:
    return controller.step(REST, REFERENCE, HOVER).inputs[0]


def test_the_own_controller_flies_until_the_first_answer(controller: ExternalController) -> None:
    own = Configuration("pid", "kalman", {"horizon": 10}).controller_for(COAXIAL_LAG, PERIOD_S)
    own.reset(REST, HOVER)
    assert step(controller) == pytest.approx(own.step(REST, REFERENCE, HOVER).inputs[0])


def test_an_answer_is_flown_and_the_plan_follows_from_it(controller: ExternalController) -> None:
    step(controller)
    assert controller.task is not None
    rows = HOVER + np.array([0.1, -0.1, 0.05, 0.02])
    assert controller.answer(controller.task.number, rows[None, :])
    result = controller.step(REST, REFERENCE, HOVER)
    assert result.inputs == pytest.approx(np.tile(rows, (9, 1)))
    assert result.fallback is None
    assert result.plan.samples[-1, 0] > 0.0


def test_later_rows_are_flown_while_answers_are_late(controller: ExternalController) -> None:
    step(controller)
    rows = HOVER + 0.05 * np.arange(3)[:, None]
    assert controller.answer(1, rows)
    flown = [step(controller) for _ in range(4)]
    assert flown == [pytest.approx(rows[i]) for i in (0, 1, 2, 2)]
    assert controller.late == 3


def test_silence_is_noticed_after_the_patience(controller: ExternalController) -> None:
    for _ in range(5):
        step(controller)
        assert not controller.silent
    step(controller)
    assert controller.silent
    assert controller.answer(6, HOVER[None, :])
    assert not controller.silent


def test_at_a_lower_rate_rows_and_patience_are_those_of_the_time(
    controller: ExternalController, clock: FakeClock
) -> None:
    step(controller)
    assert controller.task is not None
    rows = HOVER + 0.01 * np.arange(9)[:, None]
    assert controller.answer(controller.task.number, rows)
    for passed, silent in ((4, False), (8, False), (12, True)):
        assert controller.silent is silent
        clock.advance(4 * PERIOD_S)
        assert step(controller) == pytest.approx(rows[min(passed - 1, 8)])
    assert controller.late == 2


def test_the_task_tells_the_state_in_which_the_answer_will_act(controller: ExternalController) -> None:
    moving = Estimate(REST.motion + np.array([0, 0, 0, 0, 0.5, 0, 0, 0]), HOVER.copy(), np.zeros(4))
    controller.step(moving, REFERENCE, HOVER)
    assert controller.task is not None
    assert controller.task.estimate.motion[0] == pytest.approx(0.01, abs=1e-3)
    assert len(controller.task.reference.samples) == 10


def test_wrong_answers_are_refused(controller: ExternalController) -> None:
    step(controller)
    assert not controller.answer(2, HOVER[None, :])
    assert not controller.answer(1, HOVER[None, :] + 2.0)
    assert not controller.answer(1, np.full((1, 4), np.nan))
    assert controller.answer(1, HOVER[None, :])
    assert not controller.answer(1, HOVER[None, :])
