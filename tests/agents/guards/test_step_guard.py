"""Whatever a controller does, the vehicle has a command, and the failure is counted and described."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.failing import FAILURES, FailingController
from support.flight import ExactEstimator, Lab, NotedController, Plant, measured, still
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.guards.step_guard import (
    DEFAULT_CONTROLLER,
    PATIENCE_S,
    SHIFTED_PLAN,
    SHIFTED_PLAN_LIMIT_S,
    StepGuard,
)
from rcopterx.agents.guards.step_guard import HOVER as HOVERING
from rcopterx.agents.pilot import CONTROLLER_REPLACED, Pilot
from rcopterx.control.interfaces import Controller, ControlStep, Estimate, NoSolutionError, never
from rcopterx.control.plugins import CONTROLLERS
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.vehicles.state import Array

PERIOD_S = 0.02
HORIZON = 5
PLACE = np.array([0.0, 0.0, 1.0])
HOVER = COAXIAL_LAG.hover_input
PATIENCE = round(PATIENCE_S / PERIOD_S)
KINDS = sorted(FAILURES)


def built(name: str) -> Controller:
    return CONTROLLERS.build(name, COAXIAL_LAG, PERIOD_S, {"horizon": HORIZON})


class Flight:
    """A pilot that hovers with a failing controller, its default controller a PID."""

    def __init__(self, course: list[str | None], default: Controller | None = None) -> None:
        self.default = built("pid") if default is None else default
        self.failing = FailingController(built("lqr"), course)
        pilot = Pilot(
            COAXIAL_LAG, self.failing, ExactEstimator(), Guidance(), default_controller=self.default
        )
        start = Estimate(still((0.0, 0.0, 1.0)).motion, HOVER, np.zeros(4))
        self.lab = Lab(pilot, Plant(COAXIAL_LAG, start, acting=HOVER))
        self.pilot = pilot
        pilot.observe(StampedMeasurement(1, 0, PERIOD_S, measured(self.lab.plant.state)))
        pilot.note_applied("armed", -1, HOVER)
        pilot.estimator.take_over(start)
        self.lab.frame = 1

    def fly(self, seconds: float) -> None:
        self.lab.run(seconds)

    @property
    def away_m(self) -> float:
        return float(np.linalg.norm(self.lab.plant.state.motion[:3] - PLACE))


courses = st.lists(st.one_of(st.none(), st.sampled_from(KINDS)), min_size=1, max_size=12)


@given(courses)
@settings(max_examples=25, deadline=None)
def test_the_vehicle_keeps_its_place_with_sound_commands_however_its_controller_fails(
    course: list[str | None],
) -> None:
    flight = Flight(course)
    flight.fly(1.0)  # the laboratory checks every command
    assert flight.away_m < 0.05
    failed = sum(
        flight.pilot.step_guard.calls.failures[kind] for kind in ("controller_raised", "controller_unusable")
    )
    asked = [course[step % len(course)] for step in range(flight.failing.steps)]
    assert failed == sum(failure is not None for failure in asked)
    longest = max((len(run) for run in "".join("x" if f else " " for f in course * 12).split()), default=0)
    assert flight.pilot.step_guard.replaced == (longest >= PATIENCE)


@pytest.mark.parametrize("failure", KINDS)
def test_a_failure_is_flown_by_the_shifted_plan_and_then_by_the_default_controller(failure: str) -> None:
    flight = Flight([None] * 10 + [failure] * 100)
    flight.fly(1.0)
    fallbacks = flight.pilot.events
    assert fallbacks[SHIFTED_PLAN] == PATIENCE
    assert fallbacks[CONTROLLER_REPLACED] == 1
    assert flight.pilot.controller is flight.default
    assert flight.failing.steps == 10 + PATIENCE


def test_without_a_plan_to_shift_the_default_controller_flies_at_once() -> None:
    flight = Flight(["raises"])
    flight.fly(0.06)
    assert flight.pilot.events[DEFAULT_CONTROLLER] == 3
    assert not flight.pilot.step_guard.replaced


def test_a_controller_that_recovers_flies_on() -> None:
    flight = Flight([None] * 20 + ["raises"] * (PATIENCE - 1))
    flight.fly(3.0)
    assert flight.pilot.controller is flight.failing
    assert flight.pilot.events[CONTROLLER_REPLACED] == 0


def test_the_default_controller_stays_until_somebody_chooses_again() -> None:
    flight = Flight([None] * 5 + ["raises"] * 20 + [None] * 1000)
    flight.fly(4.0)
    assert flight.pilot.controller is flight.default
    chosen = built("lqr")
    flight.pilot.use_controller(chosen)
    flight.fly(0.5)
    assert flight.pilot.controller is chosen
    assert not flight.pilot.remarks


def test_what_was_raised_is_told_with_its_text() -> None:
    flight = Flight([None, None, "raises"])
    flight.fly(0.2)
    (remark,) = flight.pilot.remarks
    assert remark.startswith("FailingController: BrokenError: a table is missing (failing.py, line ")
    flight = Flight(["raises"])
    flight.fly(0.5)
    (remark,) = flight.pilot.remarks
    assert "; the default controller flies until one is chosen" in remark


def test_the_replacement_does_not_bump() -> None:
    flight = Flight([None] * 40 + ["returns nothing"] * 100)
    flight.fly(2.0)
    inputs = np.array([flown.input for flown in flight.lab.flights])
    assert np.abs(np.diff(inputs, axis=0)).max() < 0.05


def test_where_the_default_controller_fails_too_a_feedback_law_keeps_the_place() -> None:
    default = FailingController(built("pid"), ["raises"])
    flight = Flight(["inputs are not a number"], default)
    flight.fly(3.0)
    assert flight.away_m < 0.05
    assert flight.pilot.events[HOVERING] > 100


def test_a_default_controller_that_is_flown_itself_is_not_replaced_by_itself() -> None:
    sound = FailingController(built("pid"), [None] * 20 + ["raises"] * 10)
    guard = StepGuard(COAXIAL_LAG, sound, sound)
    estimate, reference = still((0.0, 0.0, 1.0)), hold(PLACE, 0.0, PERIOD_S, HORIZON)
    guard.reset(estimate, HOVER)
    fallbacks = [guard.step(estimate, reference, HOVER).fallback for _ in range(90)]
    assert set(fallbacks) == {None, SHIFTED_PLAN}
    assert guard.calls.failures["controller_raised"] == 30


def test_a_shifted_plan_has_an_end() -> None:
    failing = FailingController(built("lqr"), [None] + ["raises"] * 100)
    guard = StepGuard(COAXIAL_LAG, failing)
    estimate, reference = still((0.0, 0.0, 1.0)), hold(PLACE, 0.0, PERIOD_S, HORIZON)
    guard.reset(estimate, HOVER)
    fallbacks = [guard.step(estimate, reference, HOVER).fallback for _ in range(60)]
    shifted = round(SHIFTED_PLAN_LIMIT_S / PERIOD_S)
    assert fallbacks == [None] + shifted * [SHIFTED_PLAN] + (59 - shifted) * [HOVERING]


class NoSolution(NotedController):
    """Finds one plan, and no further one."""

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        if self.asked:
            raise NoSolutionError
        return super().step(estimate, reference, last_input, expired)


def test_a_shifted_plan_has_the_stage_and_the_end_of_the_time_while_periods_are_left_out() -> None:
    rows = HOVER + 0.01 * np.arange(20)[:, None]
    guard = StepGuard(COAXIAL_LAG, NoSolution(rows, horizon=21))
    estimate, reference = still((0.0, 0.0, 1.0)), hold(PLACE, 0.0, PERIOD_S, 21)
    guard.reset(estimate, HOVER)
    guard.step(estimate, reference, HOVER)
    for stage in (4, 8, 12):
        for _ in range(3):
            guard.leave_out()
        step = guard.step(estimate, reference, HOVER)
        assert (step.fallback, step.inputs[0, 0]) == (SHIFTED_PLAN, pytest.approx(rows[stage, 0]))
    for _ in range(3):
        guard.leave_out()
    assert guard.step(estimate, reference, HOVER).fallback == HOVERING


def test_a_controller_is_given_up_after_the_same_time_while_periods_are_left_out() -> None:
    guard = StepGuard(COAXIAL_LAG, FailingController(built("lqr"), [None] + ["raises"] * 100))
    estimate, reference = still((0.0, 0.0, 1.0)), hold(PLACE, 0.0, PERIOD_S, HORIZON)
    guard.reset(estimate, HOVER)
    failed = 0
    while not guard.given_up:
        failed += guard.step(estimate, reference, HOVER).fallback is not None
        for _ in range(2):
            guard.leave_out()
    assert failed == 2


def test_an_estimate_that_is_not_finite_still_gives_a_command() -> None:
    failing = FailingController(NotedController(HOVER[None, :]), ["raises"])
    lost = Estimate(np.full(8, np.nan), np.full(4, np.nan), np.full(4, np.nan))
    step = StepGuard(COAXIAL_LAG, failing).step(lost, hold(PLACE, 0.0, PERIOD_S, 8), HOVER)
    assert np.isfinite(step.inputs).all()
    assert np.isfinite(step.plan.samples).all()


class Deaf(NotedController):
    """Raises when it gets neighbours or limits, and when it is reset."""

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        raise ValueError("not now")


def test_what_is_raised_in_a_reset_is_a_failure_like_any_other() -> None:
    guard = StepGuard(COAXIAL_LAG, Deaf(HOVER[None, :]))
    guard.reset(still(), HOVER)
    assert guard.calls.failures["controller_raised"] == 1
    line = Deaf.reset.__code__.co_firstlineno + 1
    assert guard.calls.failure == f"Deaf: ValueError: not now (test_step_guard.py, line {line})"


class Slow(NotedController):
    """Takes its time."""

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        step = super().step(estimate, reference, last_input, expired)
        LimitOfTests.used = 0.05
        return step


class LimitOfTests:
    used = 0.0


def test_a_step_that_took_too_long_does_not_count_although_it_came() -> None:
    from rcopterx.agents.guards.time_limit import TimeLimit

    class Measured(TimeLimit):
        def end(self, limit_s: float) -> bool:
            return LimitOfTests.used > limit_s

    guard = StepGuard(COAXIAL_LAG, Slow(HOVER[None, :]))
    guard.calls.limit = Measured()
    estimate, reference = still((0.0, 0.0, 1.0)), hold(PLACE, 0.0, PERIOD_S, 8)
    guard.reset(estimate, HOVER)
    assert guard.step(estimate, reference, HOVER).fallback == HOVERING
    assert guard.calls.failures["controller_late"] == 1


class Answers(NotedController):
    """Returns inputs and a plan of these numbers."""

    def __init__(self, inputs: object, samples: object) -> None:
        super().__init__(HOVER[None, :])
        self.answer = inputs, samples

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        inputs, samples = self.answer
        return ControlStep(inputs, Trajectory(samples, PERIOD_S), None, 0)  # type: ignore[arg-type]  # on purpose


STAGES = 8
INPUTS, SAMPLES = np.tile(HOVER, (STAGES - 1, 1)), np.zeros((STAGES, 12))


@pytest.mark.parametrize(
    ("inputs", "samples", "said"),
    [
        (INPUTS.tolist(), SAMPLES, "inputs are list and no array"),
        (INPUTS, None, "plan are NoneType and no array"),
        (INPUTS[:-1], SAMPLES, "inputs have shape (6, 4) of float64, not (7, 4) of float64"),
        (INPUTS[0], SAMPLES, "inputs have shape (4,) of float64, not (7, 4) of float64"),
        (INPUTS, SAMPLES[:, :11], "plan have shape (8, 11) of float64, not (8, 12) of float64"),
        (INPUTS.astype(np.float32), SAMPLES, "inputs have shape (7, 4) of float32, not (7, 4) of float64"),
        (INPUTS, SAMPLES.astype(">f8"), "plan have shape (8, 12) of >f8, not (8, 12) of float64"),
        (INPUTS, SAMPLES.astype(object), "plan have shape (8, 12) of object, not (8, 12) of float64"),
        (INPUTS[::-1], SAMPLES.astype(int), "plan have shape (8, 12) of int64, not (8, 12) of float64"),
        (INPUTS, SAMPLES + np.nan, "the plan is not finite, or beyond all reason"),
        (INPUTS + 9.0, SAMPLES, "inputs are not finite, or leave the limits of the vehicle"),
    ],
)
def test_what_is_wrong_with_an_answer_is_told(inputs: object, samples: object, said: str) -> None:
    guard = StepGuard(COAXIAL_LAG, Answers(inputs, samples))
    estimate, reference = still((0.0, 0.0, 1.0)), hold(PLACE, 0.0, PERIOD_S, STAGES)
    guard.reset(estimate, HOVER)
    assert guard.step(estimate, reference, HOVER).fallback == HOVERING
    assert guard.calls.failures == {"controller_unusable": 1}
    assert guard.calls.failure == f"Answers: {said}"
