"""Whatever an estimator does, the pilot has an estimate, and failures are counted and described."""

from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.failing import BrokenError
from support.flight import ExactEstimator, still
from support.records import replace
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.estimation import FIRST_CALLS, EstimatorGuard
from rcopterx.agents.guards.time_limit import TimeLimit
from rcopterx.control.interfaces import Estimate, Measurement, TiltEstimate
from rcopterx.control.models.prediction import is_finite
from rcopterx.vehicles.state import Array

PLACE = Measurement(np.array([0.1, 0.2, 1.0]), 0.3)
HOVER = COAXIAL_LAG.hover_input
METHODS = ("reset", "take_over", "predict", "correct", "estimate")


class FailingEstimator(ExactEstimator):
    """Fails in one method after `sound_calls` calls of it."""

    def __init__(self, method: str, sound_calls: int = 0) -> None:
        super().__init__()
        self._method = method
        self._left = sound_calls

    def _call(self, method: str) -> None:
        if method == self._method:
            self._left -= 1
            if self._left < 0:
                raise BrokenError("no covariance")

    def reset(self, measurement: Measurement) -> None:
        self._call("reset")
        super().reset(measurement)

    def take_over(self, estimate: Estimate) -> None:
        self._call("take_over")
        super().take_over(estimate)

    def predict(self, applied_input: Array, period_s: float) -> None:
        self._call("predict")
        super().predict(applied_input, period_s)

    def correct(self, measurement: Measurement) -> bool:
        self._call("correct")
        return super().correct(measurement)

    @property
    def estimate(self) -> Estimate:
        self._call("estimate")
        return super().estimate


def fly(guard: EstimatorGuard, periods: int = 20, together: bool = True) -> None:
    guard.reset(PLACE)
    for _ in range(periods):
        if together:
            guard.correct(PLACE, [(HOVER, 0.01), (HOVER, 0.01)])
        else:
            guard.predict(HOVER, 0.02)
            guard.correct(PLACE)
    guard.take_over(guard.estimate)


@given(st.sampled_from(METHODS), st.integers(0, 30), st.booleans())
@settings(max_examples=60, deadline=None)
def test_the_default_estimator_goes_on_from_the_last_good_estimate(
    method: str, sound_calls: int, together: bool
) -> None:
    sound = EstimatorGuard(ExactEstimator())
    guard = EstimatorGuard(FailingEstimator(method, sound_calls), ExactEstimator())
    fly(sound, together=together)
    fly(guard, together=together)
    assert np.allclose(guard.estimate.motion, sound.estimate.motion)
    assert np.allclose(guard.estimate.actuator, sound.estimate.actuator)
    assert guard.replaced == (guard.calls.failures["estimator_raised"] > 0)
    assert guard.calls.failures["estimator_raised"] <= 1
    if guard.replaced:
        where = "FailingEstimator: BrokenError: no covariance (test_estimation.py, line "
        assert guard.calls.failure.startswith(where)


@pytest.mark.parametrize("method", METHODS)
def test_without_another_estimator_the_last_good_estimate_stays(method: str) -> None:
    guard = EstimatorGuard(FailingEstimator(method))
    fly(guard)
    assert is_finite(guard.estimate)
    assert guard.calls.failures["estimator_raised"] > 0


class Diverging(ExactEstimator):
    def __init__(self, change: dict[str, Any]) -> None:
        super().__init__()
        self._change = change

    @property
    def estimate(self) -> Estimate:
        return replace(super().estimate, **self._change)


@pytest.mark.parametrize(
    "change",
    [
        {"motion": np.full(8, np.nan)},
        {"motion": np.zeros(7)},
        {"motion": np.zeros(8, dtype=np.float32)},
        {"motion": [0.0] * 8},
        {"motion": np.zeros(8)[:0]},
        {"disturbance": np.full(4, np.inf)},
        {"tilt": TiltEstimate(np.zeros(4), np.zeros(3), np.zeros(2), np.zeros(2))},
    ],
)
def test_an_unusable_estimate_is_not_used(change: dict[str, Any]) -> None:
    guard = EstimatorGuard(Diverging(change), ExactEstimator())
    fly(guard)
    assert guard.replaced
    assert guard.calls.failures["estimator_unusable"] == 1
    assert guard.estimate.motion[:2] == pytest.approx(PLACE.position_m[:2], abs=1e-2)


def test_the_default_estimator_stays_until_another_one_is_selected() -> None:
    guard = EstimatorGuard(FailingEstimator("predict"), ExactEstimator())
    fly(guard)
    assert guard.replaced
    guard.use(ExactEstimator(), started=True)
    fly(guard)
    assert not guard.replaced
    assert not guard.calls.failure
    assert guard.events == {"estimator_raised": 1}


def test_a_call_that_takes_too_long_is_a_failure_but_for_the_first_ones() -> None:
    class Slow(TimeLimit):
        def end(self, limit_s: float) -> bool:
            return limit_s < 0.02

    guard = EstimatorGuard(ExactEstimator(), ExactEstimator())
    guard.calls.limit = Slow()
    guard.reset(PLACE)
    for _ in range(FIRST_CALLS - 2):
        guard.predict(HOVER, 0.02)
    assert not guard.replaced
    guard.predict(HOVER, 0.02)
    assert guard.replaced
    assert guard.calls.failures["estimator_late"] == 1


def test_events_of_an_estimator_are_among_those_of_its_guard() -> None:
    class Counting(ExactEstimator):
        events: ClassVar = {"tilt_distrusted": 2}
        restarts = 1

    assert EstimatorGuard(Counting()).events == {"tilt_distrusted": 2, "jump_accepted": 1}


@pytest.mark.parametrize(
    ("answer", "kind"),
    [
        (np.full(3, np.nan), "estimator_unusable"),
        (np.zeros(2), "estimator_unusable"),
        (None, "estimator_raised"),
    ],
)
def test_an_unusable_uncertainty_is_unknown_and_the_estimator_stays(answer: Array | None, kind: str) -> None:
    class WithUncertainty(ExactEstimator):
        def position_deviation_m(self) -> Array:
            return answer

    guard = EstimatorGuard(WithUncertainty(), default=ExactEstimator())
    assert guard.position_deviation_m() is None
    assert guard.calls.failures == {kind: 1}
    assert not guard.replaced


def test_the_uncertainty_of_an_estimator_is_returned() -> None:
    class WithUncertainty(ExactEstimator):
        def position_deviation_m(self) -> Array:
            return np.array([0.1, 0.2, 0.3])

    deviation_m = EstimatorGuard(WithUncertainty()).position_deviation_m()
    assert deviation_m is not None
    assert deviation_m.tolist() == [0.1, 0.2, 0.3]
    assert EstimatorGuard(ExactEstimator()).position_deviation_m() is None


def test_the_first_estimate_is_at_rest() -> None:
    guard = EstimatorGuard(FailingEstimator("estimate"))
    assert np.array_equal(guard.estimate.motion, still().motion)
